# SPDX-License-Identifier: Apache-2.0
"""Implementations of farthest point sampling, which all give the same indices: two compiled packages, and NumPy.

Ties go to the point that comes first in the leaves of a k-d tree, as in fpsample: see
docs/adr/0002-farthest-point-order.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from doorstate.clouds.slab_sampling import slab_farthest_points
from doorstate.types import Indices, Points

_FEWEST_ROWS = 4  # fpsample and torch-quickfps cannot build a tree of fewer


class Sampler(NamedTuple):
    """Farthest point sampling by one library.

    Attributes:
        library: name of the package that computes it.
        choose: function of points (N, 3) float32 whose row 0 is lowest on every axis, of the number of rows to choose,
            and of the height of the k-d tree that breaks ties. It starts with row 0, and returns row numbers.
    """

    library: str
    choose: Callable[[Points, int, int], Indices]

    def __call__(self, points: Points, count: int, height: int) -> Indices:
        """Return `count` row numbers (count,) int64 in farthest-point order, row 0 first."""
        choose = self.choose if len(points) >= _FEWEST_ROWS else slab_farthest_points
        return choose(points, count, height)


def choose_sampler(*, import_torch: bool = False) -> Sampler:
    """Return the quickest implementation that is installed: fpsample, torch-quickfps, or else NumPy.

    Importing torch takes longer than sampling thousands of clouds with NumPy saves on a robot. So torch-quickfps is
    used only where the process has imported torch already, or where the caller allows the import.

    Args:
        import_torch: import torch for torch-quickfps, as long work on many whole clouds should.
    """
    sampler = find_fpsample()
    if sampler is None and (import_torch or "torch" in sys.modules):
        sampler = find_torch_quickfps()
    return sampler or NUMPY


NUMPY = Sampler("numpy", slab_farthest_points)


@cache
def find_fpsample() -> Sampler | None:
    """Return the form of fpsample; None if it is not installed."""
    try:  # ships as source, and needs a C++ compiler
        import fpsample
    except ImportError:
        return None

    def choose(points: Points, count: int, height: int) -> Indices:
        # fpsample 1.0 applies `start_idx` after its tree has reordered the points. The anchor is lowest on every axis
        # and stays in row 0 through every split, so row 0 is the start.
        chosen = fpsample.bucket_fps_kdline_sampling(points, count, h=height, start_idx=0)
        return np.asarray(chosen, dtype=np.int64)

    return Sampler("fpsample", choose)


@cache
def find_torch_quickfps() -> Sampler | None:
    """Return the form of torch-quickfps; None if it is not installed, or built for another torch. Imports torch."""
    if find_spec("torch_quickfps") is None or find_spec("torch") is None:
        return None
    try:
        import torch
        import torch_quickfps
    except (ImportError, OSError, RuntimeError):  # built for another torch
        return None

    def choose(points: Points, count: int, height: int) -> Indices:
        chosen = torch_quickfps.sample_idx(torch.from_numpy(points), count, h=height, start_idx=0)
        return np.asarray(chosen.numpy(), dtype=np.int64)

    return Sampler("torch-quickfps", choose)
