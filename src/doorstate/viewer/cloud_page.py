# SPDX-License-Identifier: Apache-2.0
"""HTML page with clouds in 3D and their predictions; it loads no other file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.floor import lowest_z_m
from doorstate.clouds.measured import is_measured
from doorstate.clouds.preparation import NUM_POINTS
from doorstate.doors.sighting import UNKNOWN_DOOR, names_of_doors
from doorstate.doorways.finder import thinned
from doorstate.errors import DoorstateError, WriteParameter, python_parameter
from doorstate.inference.door_lines import Line, door_lines
from doorstate.inference.known import DoorKnown
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.posed import predict_posed
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.serialization import prediction_to_dict
from doorstate.pages.colors import STATE_COLORS
from doorstate.pages.document import fill_page
from doorstate.pages.encoding import encode_bytes, encode_cloud, encode_detections
from doorstate.pages.plan import make_plan, plan_walls
from doorstate.pages.plan_svg import plan_svg
from doorstate.types import STATES, Points
from doorstate.viewer.named_clouds import NamedCloud

Entry = dict[str, Any]
"""Cloud as the page gets it: `name` and `truth`, and either `error` or `prediction`, `cloud`, `whole`, `floor_z_m`,
`plan` and `detections`; of a live camera `facts` as well."""

WHOLE_POINTS = 8000  # of the whole cloud, drawn under the points that were used
_PLAN_PX_PER_M = 48.0  # beside the cloud
CHANNEL_STEPS = 32  # a channel count is stored in steps of 1/32, so that two bytes hold 0 to 2047


class Shown(NamedTuple):
    """Doors to ask for and to draw."""

    door_known: DoorKnown = False
    refused: bool = False  # draw candidates that are no doors, too


SHOWN = Shown()


def make_entry(
    predictor: Predictor,
    named: NamedCloud,
    parameter: WriteParameter = python_parameter,
    shown: Shown = SHOWN,
    take: Callable[[Prediction], None] | None = None,
) -> Entry:
    """Predict a cloud, and encode the prediction with the points that were used, at most 4096.

    Args:
        predictor: network or rule.
        named: cloud.
        parameter: how errors write parameters.
        shown: known door, and candidates to draw.
        take: gets the prediction of a cloud that can be used.
    """
    entry: Entry = {"name": named.name, "truth": named.truth}
    try:
        if isinstance(named.cloud, DoorstateError):
            raise named.cloud
        prediction = predict_posed(predictor, named.cloud, named.pose, shown.door_known)
        if take is not None:
            take(prediction)
        prepared = predictor.prepare(named.cloud, is_level=prediction.tilt is None)
    except DoorstateError as error:
        return entry | {"error": error.describe(parameter, with_path=False)}
    counts = None if prediction.state is None else _channel_counts(predictor, prepared.points)
    if counts is not None:
        steps = np.rint(counts[:NUM_POINTS] * CHANNEL_STEPS).astype("<u2")
        entry["channels"] = encode_bytes(steps.tobytes())
    parts = None if named.parts is None else named.parts[prepared.indices[:NUM_POINTS]]
    entry["cloud"] = encode_cloud(prepared.points[:NUM_POINTS], parts)
    return entry | _encode_prediction(prediction, named, parameter, shown)


def make_live_entry(
    prediction: Prediction,
    named: NamedCloud,
    facts: Sequence[tuple[str, str]],
    parameter: WriteParameter = python_parameter,
    names: Sequence[str | None] = (),
) -> Entry:
    """Encode a prediction that was made elsewhere, with the cloud alone.

    Args:
        prediction: prediction for the cloud.
        named: cloud; an error without one.
        facts: names and texts to list besides those of the prediction.
        parameter: how errors write parameters.
        names: name of each door of a list; None for one that is not in it.
    """
    entry: Entry = {"name": named.name, "truth": "", "facts": list(facts)}
    if isinstance(named.cloud, DoorstateError):
        return entry | {"error": named.cloud.describe(parameter, with_path=False)}
    encoded = _encode_prediction(prediction, named, parameter, SHOWN, names)
    return entry | encoded | {"cloud": encoded["whole"]}


def _encode_prediction(
    prediction: Prediction,
    named: NamedCloud,
    parameter: WriteParameter,
    shown: Shown,
    names: Sequence[str | None] = (),
) -> Entry:
    assert not isinstance(named.cloud, DoorstateError)
    whole = thin_for_display(named.cloud)
    if prediction.tilt is not None:
        whole = prediction.tilt.to_level(whole)
    floor_z_m = lowest_z_m(whole)
    record = prediction_to_dict(prediction, parameter, named.pose)
    labels = [name or UNKNOWN_DOOR for name in names]
    return {
        "prediction": names_of_doors(record, names) if names else record,
        "whole": encode_cloud(whole),
        "floor_z_m": round(floor_z_m, 3),
        "plan": _plan(named.cloud, prediction, floor_z_m, names),
        "detections": [
            *encode_detections(prediction.detections),
            *map(_encode_line, door_lines(prediction, floor_z_m, refused=shown.refused, names=labels)),
        ],
    }


def _plan(cloud: Points, prediction: Prediction, floor_z_m: float, names: Sequence[str | None]) -> str:
    """Return the doors from above as SVG; empty without any."""
    if not prediction.doors:
        return ""
    sample = thinned(cloud)
    level = sample if prediction.tilt is None else prediction.tilt.to_level(sample)
    return plan_svg(make_plan(prediction, names, plan_walls(level, floor_z_m)), px_per_m=_PLAN_PX_PER_M)


def thin_for_display(cloud: Points, count: int = WHOLE_POINTS) -> Points:
    """Return at most `count` measured points, spread evenly over rows and columns or over the order of points.

    Args:
        cloud: (N, 3) or organized (H, W, 3).
        count: largest number of points.
    """
    measured = is_measured(cloud)
    share = max(1.0, float(measured.sum()) / count)
    if cloud.ndim == 3:
        step = math.ceil(math.sqrt(share))
        cloud, measured = cloud[::step, ::step], measured[::step, ::step]
    points = cloud[measured]
    return points[:: max(1, math.ceil(len(points) / count))]


def _encode_line(line: Line) -> dict[str, Any]:
    return {"name": line.name, "points": np.round(line.points_m, 3).tolist(), "label": line.label}


def _channel_counts(predictor: Predictor, points: Points) -> NDArray[np.float32] | None:
    """Return (N,) channel counts of the points; None where these are not defined."""
    if not isinstance(predictor, NetworkPredictor) or (network := predictor.backend.network) is None:
        return None
    if predictor.card.input != "whole":  # the points are those of several crops
        return None
    from doorstate.viewer.critical_points import critical_points  # needs torch, an exported network does not

    return critical_points(network, points, predictor.backend.card.normalization)


def render_cloud_page(predictor: Predictor, entries: Sequence[Entry], *, live: bool = False) -> str:
    """Return the page.

    Args:
        predictor: network or rule, to be named on the page.
        entries: results of `make_entry`; may be empty in a live page.
        live: receive more entries as server-sent events from the address `events`.
    """
    return fill_page(
        "view.html",
        "doorstate.viewer",
        ("page.css", "view.css", "clouds.js", "view.js"),
        live=live,
        heading="Waiting for the first cloud" if live else "",
        predictor=str(predictor),
        page_data={
            "entries": list(entries),
            "live": live,
            "states": STATES,
            "state_colors": STATE_COLORS,
            "channel_steps": CHANNEL_STEPS,
        },
    )
