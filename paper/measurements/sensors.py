# SPDX-License-Identifier: Apache-2.0
"""Sensor models beside published figures of the sensors: noise, steps, shadows and missing pixels on rendered walls."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.noise.model import Model, SensorModel, distort
from doorstate.simulation.noise.sensors import STAGE_SENSORS as SENSORS
from doorstate.simulation.render import incidence, is_made_of, render, render_behind_glass
from doorstate.simulation.scene import Box, Material
from doorstate.types import DepthImage, Part

DEPTHS_M = (1.0, 2.0, 3.0, 3.5, 5.0)
TILTS_DEG = (62.0, 70.0, 75.0, 80.0, 84.0)
AHEAD = CameraPose(0.0, 0.0, 0.0, 0.0)
_STAGES = set(SensorModel.model_fields) - {"kind", "name", "camera"}
_FAR_M = 100.0
_Seeds = Sequence[int]
_NOTE = (
    "On rendered walls, without the limits of the range. Axial noise is that of the whole output with its "
    "rounding; for deepdoors2 it is that before depth is rounded to 1/16 m."
)


class SensorResult(NamedTuple):
    """One published figure and the value of the model."""

    sensor: str
    quantity: str
    condition: str
    unit: str
    published: float
    measured: float


def nguyen_m(depth_m: float, incidence_deg: float = 0.0) -> float:
    """Return the axial standard deviation of Kinect v1 in metres (Nguyen, Izadi and Lovell 2012)."""
    sigma = 0.0012 + 0.0019 * (depth_m - 0.4) ** 2
    if incidence_deg > 60:
        angle = math.radians(incidence_deg)
        sigma += 0.0001 / math.sqrt(depth_m) * angle**2 / (math.pi / 2 - angle) ** 2
    return sigma


# Focal length in pixels, baseline in metres and step of disparity in pixels of each camera.
_GEOMETRY = {
    "xtion": (577.3, 0.075, 1 / 8),
    "kinect": (589.4, 0.075, 1 / 8),
    "d435": (424.0, 0.050, 1 / 32),
    "deepdoors2": (384.681, 0.050, 1 / 32),
}
PUBLISHED_SIGMA_M: dict[str, Callable[[float], float]] = {
    "gaussian": lambda z: 0.01,
    "xtion": nguyen_m,
    "kinect": nguyen_m,
    "d435": lambda z: 0.08 * z * z / (424.0 * 0.050),
    "deepdoors2": lambda z: 0.08 * z * z / (384.681 * 0.050),
}


def with_stages(model: SensorModel, *stages: str) -> SensorModel:
    """Return the model with these stages only."""
    return model.model_copy(update=dict.fromkeys(_STAGES - set(stages)))


def wall(depth_m: float, tilt_deg: float = 0.0, material: Material = "matte") -> Box:
    """Return a wall that the viewing axis meets at this depth, tilted about the vertical through that point."""
    tilt = math.radians(tilt_deg)
    center = depth_m + 0.5 * math.cos(tilt), 0.5 * math.sin(tilt), 0.0
    return Box(Part.WALL, center, (1.0, 2 * _FAR_M, 2 * _FAR_M), tilt, material)


def cropped(model: Model, width: int, height: int) -> Intrinsics:
    """Return the camera of the middle of the model's image."""
    middle = (width - 1) / 2, (height - 1) / 2
    return replace(model.camera.intrinsics(), width=width, height=height, cx=middle[0], cy=middle[1])


def measure_depth(model: Model, boxes: Sequence[Box], pinhole: Intrinsics, seeds: _Seeds) -> DepthImage:
    """Return (seeds, H, W) measured depth in metres, without the limits of the sensor's range."""
    rendered = render_behind_glass(boxes, AHEAD, pinhole)
    return np.stack([distort(model, rendered, boxes, AHEAD, pinhole, seed).depth_m for seed in seeds])


def measure_sensors(seeds: _Seeds, progress: Progress) -> list[SensorResult]:
    """Return all published figures with the values of the models."""
    parts = (_sigmas, _steps, _tilted_sigmas, _hidden, _ragged, _lost)
    results: list[SensorResult] = []
    for number, part in enumerate(parts):
        progress(number, len(parts))
        results += part(seeds)
    progress(len(parts), len(parts))
    return results


def sensors_table(
    results: Sequence[SensorResult], title: str = "Sensor models and published figures", note: str = _NOTE
) -> Table:
    """Return one row per published figure."""
    lines = tuple(
        (
            result.sensor,
            result.quantity,
            result.condition,
            result.unit,
            f"{result.published:.4g}",
            f"{result.measured:.4g}",
            f"{100 * (result.measured / result.published - 1):+.1f}",
        )
        for result in results
    )
    return Table(
        title,
        ("sensor", "quantity", "condition", "unit", "published", "measured", "deviation, %"),
        lines,
        note,
        text_columns=4,
    )


def _sigmas(seeds: _Seeds) -> Iterator[SensorResult]:
    for name, published in PUBLISHED_SIGMA_M.items():
        model = SENSORS[name].model_copy(update={"depth_steps": None})
        pinhole = cropped(model, 160, 120)
        for depth_m in DEPTHS_M:
            image = measure_depth(model, [wall(depth_m)], pinhole, seeds)
            sigma_mm = 1000 * float(np.nanstd(image.astype(np.float64)))
            yield SensorResult(
                name, "axial noise", f"{depth_m:g} m", "mm", 1000 * published(depth_m), sigma_mm
            )


def _steps(seeds: _Seeds) -> Iterator[SensorResult]:
    for name, (focal_px, baseline_m, step_px) in _GEOMETRY.items():
        model = with_stages(SENSORS[name], "axial", "disparity_steps")
        for depth_m in (1.0, 2.0, 3.0):
            levels = np.unique(measure_depth(model, [wall(depth_m, 30.0)], cropped(model, 160, 120), seeds))
            near = levels[np.abs(levels / depth_m - 1) < 0.03].astype(np.float64)
            published = 1000 * depth_m**2 * step_px / (focal_px * baseline_m)
            yield SensorResult(
                name, "step of disparity", f"{depth_m:g} m", "mm", published, 1000 * np.diff(near).mean()
            )
    model = SENSORS["deepdoors2"]
    levels = np.unique(measure_depth(model, [wall(2.0, 30.0)], cropped(model, 160, 120), seeds))
    yield SensorResult(
        "deepdoors2", "step of depth", "2 m", "mm", 62.5, 1000 * np.diff(levels[~np.isnan(levels)]).min()
    )


def _tilted_sigmas(seeds: _Seeds) -> Iterator[SensorResult]:
    for name in ("xtion", "kinect"):
        model = with_stages(SENSORS[name], "axial", "disparity_steps")
        pinhole = cropped(model, 15, 121)
        for tilt_deg in TILTS_DEG:
            boxes = [wall(2.0, tilt_deg)]
            rendered = render(boxes, AHEAD, pinhole)
            angle_deg = np.degrees(incidence(rendered, boxes, AHEAD, pinhole))
            published = np.vectorize(nguyen_m)(rendered.depth_m, angle_deg)
            error = (measure_depth(model, boxes, pinhole, seeds) - rendered.depth_m) / published
            at_centre = 1000 * nguyen_m(2.0, tilt_deg)
            sigma_mm = at_centre * math.sqrt(np.square(error).mean())
            yield SensorResult(name, "axial noise", f"2 m, {tilt_deg:g} degrees", "mm", at_centre, sigma_mm)


def _hidden(seeds: _Seeds) -> Iterator[SensorResult]:
    for name, (focal_px, baseline_m, _) in _GEOMETRY.items():
        model = with_stages(SENSORS[name], "second_view")
        for near_m in (1.0, 2.0):
            # Shadows are whole pixels wide, so this is a mean over many depths.
            spread = np.linspace(-0.05, 0.05, 15)
            pairs = [(near_m * (1 + near), 3.0 * (1 + far)) for near in spread for far in spread]
            lost = [_shadow_px(model, *pair, upright=name == "deepdoors2") for pair in pairs]
            published = np.mean([focal_px * baseline_m * (1 / near - 1 / far) for near, far in pairs])
            condition = f"edge about {near_m:g} m, wall about 3 m"
            yield SensorResult(name, "shadow", condition, "px", float(published), float(np.mean(lost)))
    for name in ("d435", "deepdoors2"):
        model = SENSORS[name]
        focal_px, baseline_m, _ = _GEOMETRY[name]
        across = model.camera.height if name == "d435" else model.camera.width
        depths_m = np.linspace(1.5, 2.5, 21)
        lost = [
            np.isnan(
                measure_depth(
                    with_stages(model, "second_view"), [wall(depth_m)], model.camera.intrinsics(), [0]
                )
            ).sum()
            for depth_m in depths_m
        ]
        published = float(np.mean(focal_px * baseline_m / depths_m))
        yield SensorResult(
            name, "band without depth", "1.5 to 2.5 m", "px", published, float(np.mean(lost)) / across
        )


def _shadow_px(model: SensorModel, near_m: float, far_m: float, *, upright: bool) -> float:
    """Return the width in pixels of the shadow of a panel in the right half of the image, the lower half if upright."""
    size, aside = [0.02, 8 * _FAR_M, 8 * _FAR_M], [0.0, 0.0]
    size[2 if upright else 1] = 2 * _FAR_M
    aside[1 if upright else 0] = -_FAR_M
    near = Box(Part.LEAF, (near_m + 0.01, *aside), tuple(size))  # type: ignore[arg-type]
    width, height = (4, 200) if upright else (200, 4)
    pinhole = replace(
        cropped(model, width, height), cx=0.0 if upright else 150.0, cy=150.0 if upright else 0.0
    )
    image = measure_depth(model, [near, wall(far_m)], pinhole, [0])[0]
    # Outside the band that the second imager does not see.
    lost = np.isnan(image[50:] if upright else image[:, 50:])
    return float(lost.sum() / 4)


def _split(material: Material = "matte") -> list[Box]:
    """Return a panel of this material at 2 m in the left half of the image, in front of a wall at 3 m."""
    return [Box(Part.LEAF, (2.01, _FAR_M, 0.0), (0.02, 2 * _FAR_M, 2 * _FAR_M), 0.0, material), wall(3.0)]


def _ragged(seeds: _Seeds) -> Iterator[SensorResult]:
    boxes = _split()
    for name in ("xtion", "kinect"):
        model = with_stages(SENSORS[name], "lateral")
        pinhole = cropped(model, 16, 480)
        clean = render(boxes, AHEAD, pinhole).depth_m
        moved = (measure_depth(model, boxes, pinhole, range(20 * len(seeds))) != clean)[..., 7:9].mean()
        # A pixel beside the edge crosses it if it is displaced by half a pixel or more.
        yield SensorResult(name, "lateral noise", "0 degrees", "px", 0.8, 0.5 / norm.isf(moved))


def _lost(seeds: _Seeds) -> Iterator[SensorResult]:
    model = SENSORS["xtion"]
    pinhole = cropped(model, 320, 240)
    for material, published in (("glass", 0.7), ("dark", 0.3)):
        boxes = _split(material)  # type: ignore[arg-type]
        is_material = is_made_of(material, render(boxes, AHEAD, pinhole), boxes)  # type: ignore[arg-type]
        lost = np.isnan(
            measure_depth(with_stages(model, "materials"), boxes, pinhole, range(5 * len(seeds)))
        )[:, is_material]
        yield SensorResult("xtion", f"lost on {material}", "2 m", "share", published, lost.mean())
    boxes = [wall(2.0, 0.0, "gloss")]
    lost = np.isnan(measure_depth(with_stages(model, "materials"), boxes, pinhole, seeds[:1])[0])
    across_deg = 2 * math.degrees(math.atan(math.sqrt(lost.sum() / math.pi) / pinhole.fx))
    yield SensorResult("xtion", "lost on gloss, across", "2 m", "degrees", 10.0, across_deg)
    for tilt_deg in (75.0, 80.0, 85.0):
        image = measure_depth(
            with_stages(model, "grazing"),
            [wall(2.0, tilt_deg)],
            cropped(model, 5, 41),
            range(40 * len(seeds)),
        )
        yield SensorResult(
            "xtion", "lost", f"{tilt_deg:g} degrees", "share", (tilt_deg - 70) / 20, np.isnan(image).mean()
        )
    boxes, narrow = _split(), cropped(model, 16, 480)
    image = measure_depth(with_stages(model, "edges"), boxes, narrow, range(20 * len(seeds)))[..., 7:9]
    clean: NDArray[np.float32] = render(boxes, AHEAD, narrow).depth_m[:, 7:9]
    lost = np.isnan(image)
    yield SensorResult("xtion", "lost at a depth edge", "2 and 3 m", "share", 0.5, lost.mean())
    yield SensorResult("xtion", "flying pixels", "2 and 3 m", "share", 0.1, (image != clean)[~lost].mean())
    for speckled, published in ((model, 0.002), (SENSORS["d435"], 0.01)):
        share = np.isnan(
            measure_depth(with_stages(speckled, "speckle"), [wall(2.0)], pinhole, range(20 * len(seeds)))
        ).mean()
        yield SensorResult(speckled.name, "speckle", "2 m", "share", published, share)
