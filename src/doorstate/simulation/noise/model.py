# SPDX-License-Identifier: Apache-2.0
"""Measurement of a rendering by a sensor model: its stages in order (docs/sensors.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from doorstate._models import FrozenModel
from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CAMERAS, CameraPose, DepthCamera
from doorstate.simulation.noise.axial import Axial, add_noise
from doorstate.simulation.noise.conditions import INDOORS, Conditions, draw_conditions
from doorstate.simulation.noise.dropout import Grazing, Speckle, lose_grazing, lose_speckle
from doorstate.simulation.noise.edges import Edges, blur_edges
from doorstate.simulation.noise.flight.model import FlightModel
from doorstate.simulation.noise.ghosts import Ghosts, add_ghosts
from doorstate.simulation.noise.lateral import Lateral, draw_moves
from doorstate.simulation.noise.matching.model import MatchingModel
from doorstate.simulation.noise.materials import Materials, lose_patches, loss_shares
from doorstate.simulation.noise.optical import View
from doorstate.simulation.noise.quantisation import (
    DepthSteps,
    DisparitySteps,
    round_depth,
    round_disparity,
)
from doorstate.simulation.noise.shadow import SecondView, hide_from_second_view
from doorstate.simulation.noise.streams import stage_rng
from doorstate.simulation.render import Render, cut_range, incidence
from doorstate.simulation.scene.box import Box
from doorstate.types import DepthImage

Number = TypeVar("Number", bound=np.generic)
_ANGLE_STEPS = np.float32(2**14)  # per radian


class SensorModel(FrozenModel):
    """A camera and its stages in the order of the fields, with noise of each pixel alone; None leaves a stage out."""

    kind: Literal["stages"] = "stages"
    name: str
    camera: DepthCamera = CAMERAS["xtion-gazebo"]
    materials: Materials | None = None
    second_view: SecondView | None = None
    lateral: Lateral | None = None
    axial: Axial | None = None
    disparity_steps: DisparitySteps | None = None
    grazing: Grazing | None = None
    edges: Edges | None = None
    speckle: Speckle | None = None
    ghosts: Ghosts | None = None
    depth_steps: DepthSteps | None = None

    def added_sigma_m(
        self, depth_m: DepthImage, incidence_rad: NDArray[np.float32], focal_px: float
    ) -> NDArray[np.float32]:
        """Return the standard deviation (H, W) of the axial noise before disparity is rounded."""
        assert self.axial is not None
        sigma: NDArray[np.float32] = self.axial.sigma_m(depth_m, incidence_rad, focal_px)
        if self.axial.kind == "nguyen" and self.disparity_steps is not None:
            # The published noise includes rounding, so its variance, step^2 / 12, is subtracted.
            step = self.disparity_steps.step_m(depth_m, focal_px)
            step *= step
            sigma *= sigma
            sigma -= step / np.float32(12)
            sigma = np.sqrt(np.maximum(sigma, np.float32(0), out=sigma), out=sigma)
        return sigma


Model = SensorModel | MatchingModel | FlightModel


def conditions_for(model: Model, seed: int, scene: str) -> Conditions | None:
    """Return the conditions of a scene (`draw_conditions`); None for sensors that do not depend on them."""
    if model.kind == "stages":
        return None
    return draw_conditions(seed, scene, model.emitter.off_share if model.emitter else 1.0)


def sense(
    model: Model,
    rendered: Render,
    boxes: Sequence[Box],
    pose: CameraPose,
    camera: DepthCamera,
    seed: int,
    conditions: Conditions = INDOORS,
) -> Render:
    """Return the sensor's measurement of a rendering, cut to the camera's range.

    Args:
        model: sensor model.
        rendered: result of `render_behind_glass` for the boxes, pose and camera.
        boxes: scene in the door frame, with the glass.
        pose: camera in the door frame.
        camera: camera of the model, or another one.
        seed: seed of the sample (`streams.sample_seed`).
        conditions: light on the scene; a `SensorModel` does not depend on it.

    Returns:
        Depth NaN, part NONE and box NO_BOX where nothing is measured; at ragged edges parts move with the depth.
    """
    return cut_range(distort(model, rendered, boxes, pose, camera.intrinsics(), seed, conditions), camera)


def distort(
    model: Model,
    rendered: Render,
    boxes: Sequence[Box],
    pose: CameraPose,
    intrinsics: Intrinsics,
    seed: int,
    conditions: Conditions = INDOORS,
) -> Render:
    """Return the measurement before the range is cut: inf where the ray hits nothing, NaN where a pixel is lost.

    Arguments are those of `sense`. A lost pixel stays lost in every later stage.
    """
    if model.kind != "stages":
        # Lost and missing pixels divide by zero and infinity on their way through the images.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return model.distort(View(rendered, boxes, pose, intrinsics, seed, conditions))
    return _through_stages(model, rendered, boxes, pose, intrinsics, seed)


def _through_stages(
    model: SensorModel,
    rendered: Render,
    boxes: Sequence[Box],
    pose: CameraPose,
    intrinsics: Intrinsics,
    seed: int,
) -> Render:
    angle_rad = _incidence(model, rendered, boxes, pose, intrinsics)
    if model.materials is not None:
        shares = loss_shares(model.materials, rendered, angle_rad, boxes)
        if shares is not None:
            patch_px, rng = model.materials.patch_px, stage_rng(seed, "materials")
            rendered = rendered._replace(depth_m=lose_patches(rendered.depth_m, shares, patch_px, rng))
    if model.second_view is not None:
        depth_m = hide_from_second_view(rendered.depth_m, model.second_view, intrinsics.fx)
        rendered = rendered._replace(depth_m=depth_m)
    if model.lateral is not None:
        moves = draw_moves(rendered, angle_rad, model.lateral, stage_rng(seed, "lateral"))
        rendered = Render(
            _moved(rendered.depth_m, *moves), _moved(rendered.part, *moves), _moved(rendered.box, *moves)
        )
        angle_rad = _moved(angle_rad, *moves)
    depth_m = surface_m = rendered.depth_m
    if model.axial is not None:
        depth_m = _with_axial_noise(model, depth_m, angle_rad, intrinsics.fx, seed)
    if model.disparity_steps is not None:
        depth_m = round_disparity(depth_m, model.disparity_steps, intrinsics.fx)
    if model.grazing is not None:
        depth_m = lose_grazing(depth_m, angle_rad, model.grazing, stage_rng(seed, "grazing"))
    if model.edges is not None:
        depth_m = blur_edges(depth_m, surface_m, model.edges, stage_rng(seed, "edges"))
    if model.speckle is not None:
        depth_m = lose_speckle(depth_m, model.speckle, stage_rng(seed, "speckle"))
    if model.ghosts is not None:
        depth_m = add_ghosts(depth_m, model.ghosts, stage_rng(seed, "ghosts"))
    if model.depth_steps is not None:
        depth_m = round_depth(depth_m, model.depth_steps)
    return rendered._replace(depth_m=depth_m)


def _incidence(
    model: SensorModel, rendered: Render, boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics
) -> NDArray[np.float32]:
    """Return the angle of incidence, or zeros if no stage needs it, because it costs as much as a rendering."""
    glossy = model.materials is not None and any(box.material == "gloss" for box in boxes)
    steep = model.lateral is not None or model.grazing is not None
    if not (glossy or steep or (model.axial is not None and model.axial.kind == "nguyen")):
        return np.zeros(rendered.box.shape, np.float32)
    # Processors differ in the last digits of an arc cosine; rounded to 2^-14 rad they agree.
    rounded: NDArray[np.float32] = (
        np.rint(incidence(rendered, boxes, pose, intrinsics) * _ANGLE_STEPS) / _ANGLE_STEPS
    )
    return rounded


def _with_axial_noise(
    model: SensorModel, depth_m: DepthImage, angle_rad: NDArray[np.float32], focal_px: float, seed: int
) -> DepthImage:
    finite = np.isfinite(depth_m)
    measured = np.where(finite, depth_m, np.float32(1))
    noisy = add_noise(measured, model.added_sigma_m(measured, angle_rad, focal_px), stage_rng(seed, "axial"))
    return np.where(finite, noisy, depth_m)


def _moved(image: NDArray[Number], targets: NDArray[np.int64], sources: NDArray[np.int64]) -> NDArray[Number]:
    changed = image.copy()
    changed.ravel()[targets] = image.ravel()[sources]
    return changed
