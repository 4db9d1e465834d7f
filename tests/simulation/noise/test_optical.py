# SPDX-License-Identifier: Apache-2.0
"""Incidence, light and surfaces that all optical sensors share; returns of glass and gloss; conditions."""

from __future__ import annotations

import numpy as np
import pytest
from paper.measurements.sensors import AHEAD, wall

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.noise.conditions import INDOORS, Conditions, draw_conditions
from doorstate.simulation.noise.optical import (
    WHITE,
    Emitter,
    View,
    angles,
    cosines,
    draw_surfaces,
    ray_lengths,
    received,
)
from doorstate.simulation.noise.returns import Returns, reflect
from doorstate.simulation.render import NO_BOX, incidence, render_behind_glass
from doorstate.simulation.scene import Box, Door, Material, Opening, Scene, scene_boxes
from doorstate.simulation.scene.capsule import Capsule
from doorstate.types import Part

CAMERA = Intrinsics.from_hfov(160, 120, np.radians(60))
EMITTER = Emitter(reach_m=6.0, sun_reach_m=1.0)


def view_of(boxes: list[Box], pose: CameraPose = AHEAD, seed: int = 0, camera: Intrinsics = CAMERA) -> View:
    return View(render_behind_glass(boxes, pose, camera), boxes, pose, camera, seed)


def test_cosines_equal_those_of_the_incidence() -> None:
    boxes = scene_boxes(Scene(door=Door(hinge="right"), has_ceiling=False), Opening(angle_deg=50))
    boxes.append(Capsule(Part.OTHER, (-0.3, 1.0, 0.85), (0.4, 0.4, 1.7)))
    pose = CameraPose.from_degrees((0.4, 2.2, 1.0), -97.0, 3.0, 2.0)
    view = view_of(boxes, pose)
    cosine = cosines(view, ray_lengths(CAMERA))
    angle = incidence(view.rendered, boxes, pose, CAMERA)
    hit = view.rendered.box != NO_BOX
    assert (view.rendered.box == len(boxes) - 1).any()
    np.testing.assert_allclose(cosine[hit], np.cos(angle[hit]), atol=1e-6)
    assert (cosine[~hit] == 1).all()
    from_table = np.degrees(angles(cosine) - angle)
    steep = angle > np.radians(20)
    assert (hit & steep).any()
    assert np.abs(from_table[hit & steep]).max() < 0.01
    assert np.abs(from_table[hit]).max() < 0.5


@pytest.mark.parametrize(("sun_share", "reach_m"), [(0.0, 6.0), (1.0, 1.0)])
def test_a_white_wall_returns_just_enough_light_at_the_reach(sun_share: float, reach_m: float) -> None:
    one = np.ones((1, 1), np.float32)
    conditions = Conditions(sun_share=sun_share)
    light = received(EMITTER, WHITE * one, one, reach_m * one, conditions)
    assert light == pytest.approx(1, rel=1e-5)
    assert received(EMITTER, WHITE / 2 * one, one, reach_m / 2 * one, conditions) == pytest.approx(
        2, rel=1e-5
    )
    assert not received(EMITTER, one, one, one, Conditions(emitter_on=False)).any()


def test_dark_surfaces_have_the_lowest_albedo_and_each_box_its_own() -> None:
    boxes = [
        Box(Part.LEAF, (2.0, y, 0.0), (0.1, 1.0, 4.0), 0.0, "dark" if y else "matte")
        for y in (-1.0, 0.0, 1.0)
    ]
    view = view_of(boxes)
    surfaces = draw_surfaces(view)
    for number in range(3):
        own = surfaces.albedo[view.rendered.box == number]
        assert (own == own[0]).all()
        assert (own[0] < 0.1) == (number != 1)
    assert not surfaces.albedo[view.rendered.box == NO_BOX].any()
    again = draw_surfaces(view)
    np.testing.assert_array_equal(surfaces.texture, again.texture)


@pytest.mark.parametrize("material", ["glass", "gloss"])
def test_patches_of_glass_and_gloss_are_lost_or_come_from_behind(material: Material) -> None:
    panel = Box(Part.LEAF, (2.0, 0.0, 0.0), (0.02, 10.0, 10.0), 0.3, material)
    shares = Returns(gloss_lost=0.3, gloss_behind=0.3)
    seen = np.zeros(3)
    for seed in range(12):
        view = view_of([panel, wall(4.0)], seed=seed)
        depth_m = reflect(shares, view, cosines(view, ray_lengths(CAMERA))).depth_m
        front = view_of([panel._replace(material="matte"), wall(4.0)]).rendered.depth_m
        seen += (
            np.isnan(depth_m).mean(),
            (depth_m > front + 1e-4).mean(),
            (np.abs(depth_m - front) < 1e-4).mean(),
        )
    lost, behind, own = seen / 12
    assert lost + behind + own == pytest.approx(1, abs=1e-6)
    expected = (0.5, 0.35) if material == "glass" else (0.3, 0.3)
    assert (lost, behind) == pytest.approx(expected, abs=0.08)


def test_conditions_are_those_of_the_scene_whatever_the_sensor() -> None:
    drawn = [draw_conditions(1, f"p{number:04d}", 0.1) for number in range(600)]
    always = [draw_conditions(1, f"p{number:04d}", 0.0) for number in range(600)]
    assert [one.sun_share for one in drawn] == [one.sun_share for one in always]
    assert all(one.emitter_on for one in always)
    assert np.mean([not one.emitter_on for one in drawn]) == pytest.approx(0.1, abs=0.04)
    assert np.mean([one.sun_share > 0 for one in drawn]) == pytest.approx(0.4, abs=0.06)
    assert draw_conditions(2, "p0001", 0.1) != drawn[1] or draw_conditions(2, "p0002", 0.1) != drawn[2]
    assert not any(draw_conditions(1, str(number), 1.0).emitter_on for number in range(9))
    assert Conditions(sun_share=0.0, emitter_on=True) == INDOORS
