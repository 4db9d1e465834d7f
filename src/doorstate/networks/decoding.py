# SPDX-License-Identifier: Apache-2.0
"""Answers of further heads in metres and degrees, in the sensor frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from doorstate._files import write_csv
from doorstate.clouds.preparation import SCALE_M
from doorstate.types import Points

Columns = dict[str, NDArray[np.float64]]
"""(M,) numbers by the manifest's name of what they answer; probabilities are `p_door` and `p_hinge_left`."""


def in_metres(answers: Mapping[str, NDArray[np.float32]], centroids: Points) -> Columns:
    """Answers of clouds that were centred on (M, 3) centroids, in metres, and divided by 3 m.

    Args:
        answers: by head, (M, answers), in the network's units (networks.heads).
        centroids: of the clouds.
    """
    found = {name: values.astype(np.float64) for name, values in answers.items()}
    columns: Columns = {}
    if "door" in found:
        columns["p_door"] = found["door"][:, 0]
    if "angle" in found:
        columns["opening_angle_deg"] = _possible(np.degrees(found["angle"][:, 0]))
    if "hinge" in found:
        columns["p_hinge_left"] = found["hinge"][:, 0]
    if "frame" in found:
        place = found["frame"][:, :2] * SCALE_M + centroids[:, :2]
        columns |= {"door_x_m": place[:, 0], "door_y_m": place[:, 1]}
        # The network answers with the yaw of the wall's normal, the manifest holds that of the wall.
        columns["door_yaw_deg"] = (np.degrees(found["frame"][:, 2]) + 90) % 360 - 180
    if "widths" in found:
        widths = found["widths"] * SCALE_M
        columns |= {"opening_width_m": widths[:, 0], "passable_width_m": widths[:, 1]}
    return columns


def _possible(angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nearest angle that a door can have, 0 to 180 degrees: a head says a direction, which can be any."""
    beyond = np.where(angle_deg < -90, 180.0, 0.0)
    return np.where(angle_deg < 0, beyond, angle_deg)


def write_answers(path: Path, samples: Sequence[str], columns: Columns) -> None:
    """Write one line per sample."""
    rows = zip(*columns.values(), strict=True)
    write_csv(
        path,
        [
            {"sample_id": sample, **{name: f"{value:.5g}" for name, value in zip(columns, row, strict=True)}}
            for sample, row in zip(samples, rows, strict=True)
        ],
    )
