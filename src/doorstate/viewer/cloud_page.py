# SPDX-License-Identifier: Apache-2.0
"""Clouds and what was said of them, as one HTML page that loads nothing from anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import NUM_POINTS, CloudSpec, prepare_cloud
from doorstate.errors import DoorstateError
from doorstate.evaluation.detections import encode_detections
from doorstate.evaluation.pages import encode_bytes, encode_cloud, render_page
from doorstate.evaluation.views import STATE_COLORS
from doorstate.inference.onnx_backend import OnnxBackend
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.inference.serialization import described
from doorstate.types import STATES, Points
from doorstate.viewer.named_clouds import NamedCloud

Entry = dict[str, Any]
"""One cloud as the page takes it; it holds an `error`, or an `answer` and a `cloud`."""

CHANNEL_PARTS = 32  # channels are counted in, so that two bytes hold 0 to 2047


def look(predictor: Predictor | RulePredictor, sighting: NamedCloud) -> Entry:
    """Ask for the state of a cloud, and keep the points that were looked at, at most 4096.

    Args:
        predictor: a network or a rule.
        sighting: of a cloud.
    """
    entry: Entry = {"name": sighting.name, "truth": sighting.truth}
    try:
        if isinstance(sighting.cloud, DoorstateError):
            raise sighting.cloud
        answer = predictor(sighting.cloud)
        if isinstance(predictor, Predictor):
            prepared = predictor.prepare(sighting.cloud)
        else:
            prepared = prepare_cloud(sighting.cloud, CloudSpec(thin=True))
    except DoorstateError as error:
        return entry | {"error": str(error)}
    channels = None if answer.state is None else _channels(predictor, prepared.points)
    parts = None if sighting.parts is None else sighting.parts[prepared.indices[:NUM_POINTS]]
    if channels is not None:
        counted = np.rint(channels[:NUM_POINTS] * CHANNEL_PARTS).astype("<u2")
        entry["channels"] = encode_bytes(counted.tobytes())
    return entry | {
        "answer": described(answer),
        "cloud": encode_cloud(prepared.points[:NUM_POINTS], parts),
        "shapes": encode_detections(answer.detections),
    }


def _channels(predictor: Predictor | RulePredictor, points: Points) -> NDArray[np.float32] | None:
    if isinstance(predictor, RulePredictor) or isinstance(predictor.network, OnnxBackend):
        return None
    # With torch, which an exported network does without.
    from doorstate.viewer.critical_points import critical_points

    return critical_points(predictor.network, points)


def render_view(predictor: Predictor | RulePredictor, entries: Sequence[Entry], *, live: bool = False) -> str:
    """The page.

    Args:
        predictor: who was asked.
        entries: of `look`; may be none in a live page.
        live: more entries come as server-sent events from `events` beside the page.
    """
    return render_page(
        "view.html.j2",
        "doorstate.viewer",
        asked=str(predictor),
        live=live,
        page_data={
            "entries": list(entries),
            "live": live,
            "states": STATES,
            "state_colors": STATE_COLORS,
            "channel_parts": CHANNEL_PARTS,
        },
    )
