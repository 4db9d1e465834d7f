# SPDX-License-Identifier: Apache-2.0
"""Head "parts": the part of the scene that each point belongs to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from doorstate.networks.heads.spec import Floats, PointHeadSpec
from doorstate.types import PARTS, Part

if TYPE_CHECKING:
    from torch import Tensor

_CLASSES = tuple(part.name.lower() for part in Part if part != Part.NONE)


def _target(parts: NDArray[np.uint8]) -> NDArray[np.int64]:
    return np.where(parts == Part.NONE, -1, parts.astype(np.int64))


def _loss(logits: Tensor, target: Tensor) -> Tensor:
    from torch.nn import functional

    has_target = target >= 0
    losses = functional.cross_entropy(logits.flatten(0, 1), target.clamp_min(0).flatten(), reduction="none")
    loss: Tensor = (losses * has_target.flatten()).sum() / has_target.sum().clamp_min(1)
    return loss


def _confusion(target: NDArray[np.int64], predicted: NDArray[np.int64]) -> NDArray[np.int64]:
    size, has_target = len(_CLASSES), target >= 0
    pairs = target[has_target] * size + predicted[has_target]
    return np.bincount(pairs, minlength=size**2).reshape(size, size)


def _intersection_over_union(counts: NDArray[np.int64]) -> Floats:
    intersection = np.diagonal(counts)
    union = counts.sum(axis=0) + counts.sum(axis=1) - intersection
    iou: Floats = np.full(len(counts), np.nan)
    np.divide(intersection, union, out=iou, where=union > 0)
    return iou


PARTS_HEAD = PointHeadSpec(
    name=PARTS,
    classes=_CLASSES,
    target=_target,
    loss=_loss,
    confusion=_confusion,
    metric=_intersection_over_union,
)
