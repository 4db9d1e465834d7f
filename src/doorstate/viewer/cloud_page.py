# SPDX-License-Identifier: Apache-2.0
"""HTML page with clouds in 3D and their predictions; it loads no other file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import NUM_POINTS
from doorstate.errors import DoorstateError, WriteParameter, python_parameter
from doorstate.evaluation.detections import encode_detections
from doorstate.evaluation.pages import encode_bytes, encode_cloud, render_page
from doorstate.evaluation.views import STATE_COLORS
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.serialization import prediction_to_dict
from doorstate.types import STATES, Points
from doorstate.viewer.named_clouds import NamedCloud

Entry = dict[str, Any]
"""Cloud as the page gets it: `name` and `truth`, and either `error` or `prediction`, `cloud` and `detections`."""

CHANNEL_STEPS = 32  # a channel count is stored in steps of 1/32, so that two bytes hold 0 to 2047


def make_entry(
    predictor: Predictor,
    named: NamedCloud,
    parameter: WriteParameter = python_parameter,
) -> Entry:
    """Predict a cloud, and encode the prediction with the points that were used, at most 4096.

    Args:
        predictor: network or rule.
        named: cloud.
        parameter: how errors write parameters.
    """
    entry: Entry = {"name": named.name, "truth": named.truth}
    try:
        if isinstance(named.cloud, DoorstateError):
            raise named.cloud
        prediction = predictor(named.cloud)
        prepared = predictor.prepare(named.cloud)
    except DoorstateError as error:
        return entry | {"error": error.describe(parameter, with_path=False)}
    counts = None if prediction.state is None else _channel_counts(predictor, prepared.points)
    if counts is not None:
        steps = np.rint(counts[:NUM_POINTS] * CHANNEL_STEPS).astype("<u2")
        entry["channels"] = encode_bytes(steps.tobytes())
    parts = None if named.parts is None else named.parts[prepared.indices[:NUM_POINTS]]
    return entry | {
        "prediction": prediction_to_dict(prediction, parameter),
        "cloud": encode_cloud(prepared.points[:NUM_POINTS], parts),
        "detections": encode_detections(prediction.detections),
    }


def _channel_counts(predictor: Predictor, points: Points) -> NDArray[np.float32] | None:
    """Return (N,) channel counts of the points; None where these are not defined."""
    network = predictor.backend.network if isinstance(predictor, NetworkPredictor) else None
    if network is None:
        return None
    from doorstate.viewer.critical_points import critical_points  # needs torch, an exported network does not

    return critical_points(network, points)


def render_cloud_page(predictor: Predictor, entries: Sequence[Entry], *, live: bool = False) -> str:
    """Return the page.

    Args:
        predictor: network or rule, to be named on the page.
        entries: results of `make_entry`; may be empty in a live page.
        live: receive more entries as server-sent events from the address `events`.
    """
    return render_page(
        "view.html.j2",
        "doorstate.viewer",
        predictor=str(predictor),
        live=live,
        page_data={
            "entries": list(entries),
            "live": live,
            "states": STATES,
            "state_colors": STATE_COLORS,
            "channel_steps": CHANNEL_STEPS,
        },
    )
