# SPDX-License-Identifier: Apache-2.0
"""Numbers of trainable parameters of the networks, for listings; needs no torch."""

from __future__ import annotations

NUM_PARAMETERS = {
    "pointnet": 3_470_540,
    "pointnet2": 1_466_179,
    "dgcnn": 1_800_067,
    "pointcnn": 592_199,
    "point2sequence": 1_835_907,
    "mvcnn": 887_299,
}
"""Parameters by name, with three classes and no further heads."""
