# SPDX-License-Identifier: Apache-2.0
"""Predictions for clouds with ghost points, with and without removal of outliers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from doorstate._jobs import no_progress
from doorstate.clouds.measured import is_measured
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.reference_clouds import reference_rows
from doorstate.rules import list_rules
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.noise.ghosts import Ghosts, add_ghosts
from doorstate.simulation.row import Row
from doorstate.types import Points

from .frames import scene_frames
from .ghost_results import GhostResult
from .methods import all_methods

SHARES = (0.001, 0.003, 0.01, 0.03)
SIDES_PX = (1, 2, 3, 5)
TOWARDS: tuple[Literal["front", "behind", "both"], ...] = ("front", "behind", "both")
SENSOR = "xtion"
_DOORS = (0, 1, 3, 5, 6, 8)  # of every nine frames: half of the doors are closed
_REFERENCE_ROWS = 72
_FLAT = ((0, 1), (0.003, 1), (0.003, 5), (0.03, 1), (0.03, 5))  # shares and sides of flat clouds


def ghost_conditions() -> list[Ghosts]:
    """Return no ghosts, and every share, size and side."""
    return [
        Ghosts(share=0, side_px=1),
        *(
            Ghosts(share=share, side_px=side_px, towards=towards)
            for share in SHARES
            for side_px in SIDES_PX
            for towards in TOWARDS
        ),
    ]


def with_ghosts(frame: Frame, ghosts: Ghosts, rng: np.random.Generator) -> Points:
    """Return the points (H, W, 3) of a frame with ghosts along their rays."""
    depth_m = frame.cut.depth_m
    return frame.points * (add_ghosts(depth_m, ghosts, rng) / depth_m)[..., None]


def measure_ghosts(
    network: str, doors: Sequence[int], conditions: Sequence[Ghosts] | None = None
) -> Iterator[list[GhostResult]]:
    """Yield the predictions of packaged weights and of every rule for simulated doors, a list for each door.

    The network gets every kind of ghosts. Rules, which take longer, get one side for each share and size, another one
    for the next door; open and semi-open doors get the smallest and largest squares. Flat clouds are those of closed
    doors.
    """
    removing = all_methods(network)
    first = removing[network]
    assert isinstance(first, NetworkPredictor)
    keeping = type(first)(first.backend, remove_outliers=False)
    for door in doors:
        row, frame = _frame_of(door)
        is_closed = row.state == "closed"
        results = []
        for number, ghosts in enumerate(conditions or ghost_conditions()):
            image = with_ghosts(frame, ghosts, np.random.default_rng((door, number)))
            tasks: list[tuple[str, Predictor, str, Points]] = [
                (network, first, "image", image),
                (network, keeping, "image", image),
            ]
            if _is_for_rules(ghosts, (number - 1) // len(TOWARDS) + door, is_closed):
                tasks += [(name, removing[name], "image", image) for name in list_rules()]
                if is_closed and (ghosts.share, ghosts.side_px) in _FLAT:
                    flat = image[is_measured(image)]
                    tasks += [(name, predictor, "flat", flat) for name, predictor in removing.items()]
            results += [
                GhostResult(
                    name,
                    form,
                    predictor.removes_outliers,
                    ghosts.share,
                    ghosts.side_px,
                    ghosts.towards,
                    door,
                    row.state,
                    predictor(cloud).label,
                )
                for name, predictor, form, cloud in tasks
            ]
        yield results


def _is_for_rules(ghosts: Ghosts, turn: int, is_closed: bool) -> bool:
    """Return True for ghosts that rules get, too."""
    if ghosts.share == 0:
        return True
    return ghosts.towards == TOWARDS[turn % len(TOWARDS)] and (
        is_closed or ghosts.side_px in (SIDES_PX[0], SIDES_PX[-1])
    )


def _frame_of(door: int) -> tuple[Row, Frame]:
    """Return a door: every other one without noise, half of them closed."""
    block, place = divmod(door // 2, len(_DOORS))
    number = 9 * block + _DOORS[place]
    if door % 2 == 0:
        row = reference_rows(_REFERENCE_ROWS)[number % _REFERENCE_ROWS]
        return row, replay(row)
    return next(scene_frames(1, SENSOR, no_progress, first=number))
