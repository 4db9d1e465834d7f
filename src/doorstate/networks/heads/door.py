# SPDX-License-Identifier: Apache-2.0
"""Head "door": probability that the cloud shows a door at all."""

from __future__ import annotations

import math

from doorstate.networks.heads.shared import binary_cross_entropy, sigmoid
from doorstate.networks.heads.spec import Column, Floats, HeadSpec, Metric, States
from doorstate.types import DOOR, NO_DOOR


def _auroc(columns: Floats, truth: Floats, states: States) -> float:
    from sklearn.metrics import roc_auc_score

    has_door = truth[:, 0] == 1
    if has_door.all() or not has_door.any():
        return math.nan
    return float(roc_auc_score(has_door, columns[:, 0]))


DOOR_HEAD = HeadSpec(
    name=DOOR,
    description="probability of a door",
    columns=(Column("p_door", "", manifest="state", parse=lambda state: float(state != NO_DOOR)),),
    num_outputs=1,
    decode=sigmoid,
    loss=binary_cross_entropy,
    metrics=(Metric("door_auroc", "door: AUROC", 4, _auroc),),
)
