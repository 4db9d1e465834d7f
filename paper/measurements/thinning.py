# SPDX-License-Identifier: Apache-2.0
"""Agreement of predictions from a part of the points with predictions from all, and the time of sampling."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.measured import is_measured
from doorstate.clouds.outliers import remove_outliers
from doorstate.clouds.preparation import prepare_cloud
from doorstate.clouds.samplers import NUMPY, Sampler, choose_sampler
from doorstate.clouds.thinning import thinned_pixels, thinned_points
from doorstate.errors import TooFewPointsError
from doorstate.evaluation.table import Table, number
from doorstate.inference.backends import run_by_size
from doorstate.inference.decode import decode
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.types import Points

CANDIDATES_PER_POINT = (2, 4, 8, 16)


class ThinningResult(NamedTuple):
    """Prediction for one cloud from a part of its points.

    Attributes:
        state: state of the door.
        form: organized or flat.
        per_point: least number of candidates per sampled point; None: all points.
        candidates: points that were sampled from.
        milliseconds: time of thinning and sampling, by name of the sampling library.
        predicted: state predicted from the sample; None where the network is not sure.
        probabilities: (3,), of the states.
    """

    state: str
    form: str
    per_point: int | None
    candidates: int
    milliseconds: dict[str, float]
    predicted: str | None
    probabilities: NDArray[np.float32]


def measure_thinning(network: str, clouds: Iterable[tuple[str, Points]]) -> list[ThinningResult]:
    """Return the predictions of packaged weights with all numbers of candidates.

    Clouds without outliers are compared; one that has too few points in any form is left out.

    Args:
        network: name of packaged weights.
        clouds: states and organized clouds (H, W, 3) in metres.
    """
    predictor = NetworkPredictor.from_weights(network, thin=False)
    samplers = {sampler.library: sampler for sampler in (NUMPY, choose_sampler(import_torch=True))}
    results = []
    for state, cloud in clouds:
        clean = remove_outliers(cloud).points
        with suppress(TooFewPointsError):
            results += list(_results(predictor, state, clean, samplers))
    return results


def _results(
    predictor: NetworkPredictor, state: str, cloud: Points, samplers: dict[str, Sampler]
) -> Iterator[ThinningResult]:
    spec = predictor.spec.model_copy(update={"remove_outliers": False})
    for form, per_point in [
        ("all", None),
        *((f, c) for f in ("organized", "flat") for c in CANDIDATES_PER_POINT),
    ]:
        min_points = None if per_point is None else per_point * predictor.num_points
        milliseconds = {}
        for library, sampler in samplers.items():
            started = time.perf_counter()
            part = _thin(cloud, form, min_points, spec.max_depth_m)
            points = prepare_cloud(part, spec, sampler).points
            milliseconds[library] = (time.perf_counter() - started) * 1000
        (outputs,) = run_by_size(predictor.backend, [points])
        predicted = decode(outputs, predictor.card.abstain_below, len(points), 0.0).state
        candidates = int(is_measured(part).sum())
        yield ThinningResult(
            state, form, per_point, candidates, milliseconds, predicted, outputs.probabilities
        )


def _thin(cloud: Points, form: str, min_points: int | None, max_depth_m: float | None) -> Points:
    """Return a part of an organized cloud, organized or flattened."""
    if min_points is None:
        return cloud
    if form == "organized":
        rows = thinned_pixels(cloud.shape[0], cloud.shape[1], min_points)
        height = len(np.unique(rows // cloud.shape[1]))
        return cloud.reshape(-1, 3)[rows].reshape(height, -1, 3)
    flat = cloud.reshape(-1, 3)
    flat = flat[is_measured(flat)]
    if max_depth_m is not None:
        flat = flat[flat[:, 0] <= max_depth_m]
    return flat[thinned_points(flat, min_points)]


def thinning_table(results: Sequence[ThinningResult]) -> Table:
    """Return one row per form and number of candidates: equal and correct states, change of probabilities, time."""
    whole = [result for result in results if result.per_point is None]
    settings = list(dict.fromkeys((result.form, result.per_point) for result in results))
    rows = []
    for form, per_point in settings:
        chosen = [result for result in results if (result.form, result.per_point) == (form, per_point)]
        pairs = list(zip(chosen, whole, strict=True))
        changes = [float(np.abs(part.probabilities - full.probabilities).max()) for part, full in pairs]
        same = sum(part.predicted == full.predicted for part, full in pairs)
        rows.append(
            (
                form,
                "all" if per_point is None else str(per_point),
                f"{np.median([result.candidates for result in chosen]):.0f}",
                f"{same} of {len(chosen)}",
                str(sum(result.predicted == result.state for result in chosen)),
                number(float(np.mean(changes))),
                number(max(changes)),
                *(
                    f"{np.median([result.milliseconds[library] for result in chosen]):.1f}"
                    for library in chosen[0].milliseconds
                ),
            )
        )
    libraries = (f"ms, {library}" for library in results[0].milliseconds)
    columns = (
        "cloud",
        "per point",
        "candidates",
        "same state",
        "correct",
        "mean change",
        "largest",
        *libraries,
    )
    return Table(
        "Sampling from a part of the points and from all",
        columns,
        tuple(rows),
        "Packaged weights on simulated doors that they were not trained on: several presets and sensors. *Per point*: "
        "least number of points to choose from, per point of the sample: pixels of an organized cloud, occupied cells "
        "of a flat one; *candidates*: their median number. Changes are those of the probability that differs most. "
        "*ms*: median time of cleaning, thinning and sampling.",
    )
