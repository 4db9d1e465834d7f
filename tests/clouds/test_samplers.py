# SPDX-License-Identifier: Apache-2.0
"""Choice of the library that samples."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest

from doorstate.clouds import samplers
from doorstate.clouds.samplers import NUMPY, Sampler, choose_sampler

FPSAMPLE, QUICKFPS = Sampler("fpsample", NUMPY.choose), Sampler("torch-quickfps", NUMPY.choose)


@pytest.fixture(autouse=True)
def fresh_choice() -> Iterator[None]:
    for find in (samplers.find_fpsample, samplers.find_torch_quickfps):
        find.cache_clear()
    yield
    for find in (samplers.find_fpsample, samplers.find_torch_quickfps):
        find.cache_clear()


@pytest.mark.parametrize("torch_imported", [False, True])
@pytest.mark.parametrize("import_torch", [False, True])
@pytest.mark.parametrize("fpsample", [None, FPSAMPLE])
@pytest.mark.parametrize("quickfps", [None, QUICKFPS])
def test_fpsample_goes_before_torch_quickfps_and_that_before_numpy(
    monkeypatch: pytest.MonkeyPatch,
    torch_imported: bool,
    import_torch: bool,
    fpsample: Sampler | None,
    quickfps: Sampler | None,
) -> None:
    monkeypatch.setattr(samplers, "find_fpsample", lambda: fpsample)
    monkeypatch.setattr(samplers, "find_torch_quickfps", lambda: quickfps)
    if torch_imported:
        monkeypatch.setitem(sys.modules, "torch", np)
    else:
        monkeypatch.delitem(sys.modules, "torch", raising=False)
    expected = fpsample or (quickfps if torch_imported or import_torch else None) or NUMPY
    assert choose_sampler(import_torch=import_torch) == expected


@pytest.mark.parametrize(
    ("package", "find"), [("fpsample", "find_fpsample"), ("torch_quickfps", "find_torch_quickfps")]
)
def test_a_package_that_is_not_installed_is_not_chosen(
    monkeypatch: pytest.MonkeyPatch, package: str, find: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    assert getattr(samplers, find)() is None


def test_tiny_clouds_are_sampled_by_numpy() -> None:
    broken = Sampler("broken", lambda points, count, height: np.full(count, -7))
    points = np.eye(3, dtype=np.float32)
    points[0] = -1
    assert sorted(broken(points, 3, 1)) == [0, 1, 2]
