# SPDX-License-Identifier: Apache-2.0
"""Matching and time-of-flight sensors beside published figures: noise, correlation, bands, fill rate and corners."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.noise.axial import NguyenAxial
from doorstate.simulation.noise.flight.model import FlightModel
from doorstate.simulation.noise.flight.sensors import FLIGHT_SENSORS
from doorstate.simulation.noise.matching.mismatches import Mismatches
from doorstate.simulation.noise.matching.model import MatchingModel
from doorstate.simulation.noise.matching.sensors import MATCHING_SENSORS
from doorstate.simulation.noise.optical import WHITE, View, draw_surfaces
from doorstate.simulation.render import render_behind_glass
from doorstate.simulation.scene import Box
from doorstate.types import Part

from .sensors import AHEAD, SensorResult, cropped, measure_depth, nguyen_m, wall

TITLE = "Sensors that match windows or measure the time of flight"
NOTE = (
    "On rendered walls. Noise is that on a white wall, without wrong planes. Correlation is that of errors before "
    "rounding, half a window apart; the published one is that of a mean over the window."
)
AT_MOST, AT_LEAST = ", at most", ", at least"
_FLIGHT_DEPTHS_M = (1.0, 2.0, 3.0, 4.0)
_MATCHING_DEPTHS_M = (1.0, 2.0, 3.0)
_ALONE = Mismatches(share=0)


def published_sigma_m(model: MatchingModel | FlightModel, depth_m: float) -> float:
    """Return the published standard deviation of a sensor's axial noise on a wall ahead."""
    if isinstance(model, FlightModel):
        axial = model.axial
        return axial.base_m + axial.linear * depth_m + axial.square_per_m * depth_m**2
    if isinstance(model.axial, NguyenAxial):
        return nguyen_m(depth_m)
    focal_px = model.camera.intrinsics().fx
    return model.axial.disparity_px * depth_m**2 / (focal_px * model.baseline_m)


def measure_optical(seeds: Sequence[int]) -> Iterator[SensorResult]:
    """Yield the figures of all matching and time-of-flight sensors."""
    for model in MATCHING_SENSORS:
        yield from _matching(model, seeds)
    for flight in FLIGHT_SENSORS:
        yield from _flight(flight, seeds)


def _matching(model: MatchingModel, seeds: Sequence[int]) -> Iterator[SensorResult]:
    alone, pinhole = model.model_copy(update={"mismatches": _ALONE}), cropped(model, 160, 120)
    for depth_m in _MATCHING_DEPTHS_M:
        image = measure_depth(alone, [wall(depth_m)], pinhole, seeds).astype(np.float64)
        sigma_mm = 1000 * published_sigma_m(model, depth_m)
        measured_mm = 1000 * float(np.nanstd(image))
        yield SensorResult(model.name, "axial noise", f"{depth_m:g} m", "mm", sigma_mm, measured_mm)
    error = measure_depth(alone, [wall(2.0)], pinhole, seeds).astype(np.float64) - 2.0
    lag = model.window_px // 2
    published = 1 - lag / model.window_px
    unrounded = published_sigma_m(model, 2.0) ** 2 - _rounding_m(model, 2.0) ** 2
    # Rounding is not correlated.
    correlation = _correlation(error, lag) * published_sigma_m(model, 2.0) ** 2 / unrounded
    yield SensorResult(model.name, "correlation", f"{lag} px", "", published, correlation)
    whole = measure_depth(model, [wall(2.0)], model.camera.intrinsics(), seeds[:1])[0]
    if model.second_imager:
        band = float(np.isnan(whole).all(axis=0).argmin())
        published = model.camera.intrinsics().fx * model.baseline_m / 2.0
        yield SensorResult(model.name, "band without depth", "2 m", "px", round(published), band)
    if model.emitter is not None:
        height, width = whole.shape
        inner = whole[height // 10 : -height // 10, width // 10 : -width // 10]
        yield SensorResult(
            model.name, "fill rate" + AT_LEAST, "2 m", "share", 0.98, float(np.isfinite(inner).mean())
        )


def _rounding_m(model: MatchingModel, depth_m: float) -> float:
    step_m = model.step_px * depth_m**2 / (model.camera.intrinsics().fx * model.baseline_m)
    return float(step_m / np.sqrt(12))


def _correlation(error: NDArray[np.float64], lag: int) -> float:
    """Return the correlation of pixels `lag` columns apart in (seeds, H, W)."""
    first, second = error[..., :-lag].ravel(), error[..., lag:].ravel()
    both = np.isfinite(first) & np.isfinite(second)
    return float(np.corrcoef(first[both], second[both])[0, 1])


def _flight(model: FlightModel, seeds: Sequence[int]) -> Iterator[SensorResult]:
    pinhole = cropped(model, 40, 40)
    biases = []
    for depth_m in _FLIGHT_DEPTHS_M:
        if depth_m >= model.camera.max_depth_m:
            continue
        boxes = [wall(depth_m)]
        rendered = render_behind_glass(boxes, AHEAD, pinhole)
        ratios, errors = [], []
        for seed in seeds:
            image = measure_depth(model, boxes, pinhole, [seed])[0].astype(np.float64)
            albedo = float(draw_surfaces(View(rendered, boxes, AHEAD, pinhole, seed)).albedo[0, 0])
            ratios.append(float(np.nanstd(image)) * albedo / WHITE)
            errors.append(abs(float(np.nanmean(image)) - depth_m))
        sigma_mm = 1000 * published_sigma_m(model, depth_m)
        measured_mm = 1000 * float(np.sqrt(np.mean(np.square(ratios))))
        yield SensorResult(model.name, "axial noise", f"{depth_m:g} m", "mm", sigma_mm, measured_mm)
        biases.append((depth_m, max(errors), measured_mm))
    if model.name.startswith("azure"):
        for depth_m, bias_m, sigma_mm in biases:
            condition = f"{depth_m:g} m"
            yield SensorResult(
                model.name, "systematic error" + AT_MOST, condition, "mm", 11 + depth_m, 1000 * bias_m
            )
            yield SensorResult(model.name, "random error" + AT_MOST, condition, "mm", 17.0, sigma_mm)
    corner = [wall(2.5), Box(Part.WALL, (0.0, -1.25, 0.0), (20.0, 0.5, 20.0))]
    pinhole = model.camera.intrinsics()
    rendered = render_behind_glass(corner, AHEAD, pinhole)
    depths = measure_depth(model, corner, pinhole, seeds).astype(np.float64)
    beside = (rendered.box == 1) & (rendered.depth_m > 2.0)
    farther = (depths - rendered.depth_m)[:, beside] * 1000
    yield SensorResult(
        model.name, "corner too deep" + AT_LEAST, "0.5 m beside", "mm", 10.0, float(np.nanmedian(farther))
    )
