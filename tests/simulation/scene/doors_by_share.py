# SPDX-License-Identifier: Apache-2.0
"""Doors that open by a share of their way, one of each kind."""

from __future__ import annotations

from doorstate.simulation.scene import Door, Opening

BI_PARTING = Door(kind="sliding_double", opening_width_m=1.6, leaf_recess_m=-0.07, stop_width_m=0.0)
LIFT = BI_PARTING.model_copy(update={"leaf_recess_m": 0.04, "leaf_material": "gloss", "opening_width_m": 0.9})
BI_FOLD = Door(kind="folding", leaf_thickness_m=0.03, stop_width_m=0.0)
TWO_PAIRS = BI_FOLD.model_copy(update={"panels": 4, "opening_width_m": 2.0})
REVOLVING = Door(kind="revolving", opening_width_m=2.0, wall_height_m=2.8, stop_width_m=0.0)
BY_SHARE = {
    "bi-parting": BI_PARTING,
    "lift": LIFT,
    "bi-fold": BI_FOLD,
    "two pairs": TWO_PAIRS,
    "revolving": REVOLVING,
}
SHARES = tuple(Opening(share=share) for share in (0.0, 0.25, 0.5, 0.75, 1.0))
