# SPDX-License-Identifier: Apache-2.0
"""Complete sensor models on walls and doors, compared with published measurements."""

from __future__ import annotations

import dataclasses
import hashlib

import numpy as np
import pytest
from paper.measurements.sensors import (
    PUBLISHED_SIGMA_M,
    SensorResult,
    cropped,
    measure_depth,
    measure_sensors,
    sensors_table,
    wall,
    with_stages,
)
from pydantic import ValidationError

from doorstate._jobs import no_progress
from doorstate.dataset.deepdoors2 import CAMERA as DEEPDOORS2
from doorstate.errors import ConfigError
from doorstate.simulation.camera import CAMERAS, CameraPose, DepthCamera
from doorstate.simulation.noise.models import SENSORS, SensorModel, distort, find_sensor, sense
from doorstate.simulation.render import NO_BOX, Render, cut_range, render_behind_glass
from doorstate.simulation.scene import Box, Door, Opening, Scene, scene_boxes
from doorstate.types import Part

POSE = CameraPose.from_degrees((0.4, 2.2, 1.0), -97.0, 3.0)
# Hinged on the right: the free edge, before what is behind it, is the leaf's left one, where shadows fall.
BOXES = scene_boxes(Scene(door=Door(hinge="right"), has_ceiling=False), Opening(angle_deg=50))
# docs/sensors.md, in mm; the Kinect's row is the Xtion's, that of `deepdoors2` the D435's for its focal length.
TABLE_MM = {
    "gaussian": dict.fromkeys((1.0, 2.0, 3.0, 3.5, 5.0), 10.0),
    "kinect": {1.0: 1.9, 2.0: 6.1, 3.0: 14.0, 3.5: 19.5, 5.0: 41.4},
    "deepdoors2": {1.0: 4.2, 2.0: 16.6, 3.0: 37.4, 3.5: 51.0, 5.0: 104.0},
    "xtion": {1.0: 1.9, 2.0: 6.1, 3.0: 14.0, 3.5: 19.5, 5.0: 41.4},
    "d435": {1.0: 3.8, 2.0: 15.1, 3.0: 34.0, 3.5: 46.2, 5.0: 94.3},
}
STEPS_MM = {1.0: 2.9, 2.0: 11.5, 3.0: 26.0}


@pytest.fixture(scope="module")
def checks() -> list[SensorResult]:
    return measure_sensors(range(3), no_progress)


def test_everything_published_is_met_within_ten_per_cent(checks: list[SensorResult]) -> None:
    apart = {(row.sensor, row.quantity, row.condition): row.measured / row.published - 1 for row in checks}
    assert len(apart) == len(checks) > 60
    assert {each: off for each, off in apart.items() if not abs(off) < 0.1} == {}
    assert {row.sensor for row in checks} == set(SENSORS) - {"none"}
    assert len(sensors_table(checks).rows) == len(checks)


def test_axial_noise_and_steps_are_those_of_the_table_in_millimetres(checks: list[SensorResult]) -> None:
    found = {(row.sensor, row.quantity, row.condition): row.measured for row in checks}
    assert set(TABLE_MM) == set(SENSORS) - {"none"}
    for name, line in TABLE_MM.items():
        for depth_m, sigma_mm in line.items():
            assert PUBLISHED_SIGMA_M[name](depth_m) * 1000 == pytest.approx(sigma_mm, abs=0.1)
            assert found[name, "axial noise", f"{depth_m:g} m"] == pytest.approx(sigma_mm, rel=0.1)
    for depth_m, step_mm in STEPS_MM.items():
        assert found["xtion", "step of disparity", f"{depth_m:g} m"] == pytest.approx(step_mm, rel=0.1)


def small(name: str) -> tuple[SensorModel, DepthCamera]:
    """A sensor with a quarter of its pixels in each direction, or all of a small one."""
    model = SENSORS[name]
    size = {
        "width": model.camera.width // 4,
        "height": model.camera.height // 4,
        "cx_px": None,
        "cy_px": None,
    }
    return model, model.camera.model_copy(update=size)


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_measures_the_same_again_and_something_else_of_another_seed(name: str) -> None:
    model, camera = small(name)
    seen = render_behind_glass(BOXES, POSE, camera.intrinsics())
    before = [image.copy() for image in seen]
    one, again, other = (sense(model, seen, BOXES, POSE, camera, seed) for seed in (5, 5, 6))
    assert all(np.array_equal(a, b) for a, b in zip(before, seen, strict=True))
    assert all(a.tobytes() == b.tobytes() and a.dtype == b.dtype for a, b in zip(one, again, strict=True))
    assert (one.depth_m.tobytes() == other.depth_m.tobytes()) == (name == "none")
    lost = np.isnan(one.depth_m)
    assert ((one.part == Part.NONE) == lost).all()
    assert ((one.box == NO_BOX) == lost).all()
    with np.errstate(invalid="ignore"):
        assert ((one.depth_m > camera.min_depth_m) & (one.depth_m < camera.max_depth_m) | lost).all()


def test_the_sensor_none_gives_every_bit_of_the_rendering() -> None:
    camera = CAMERAS["xtion-gazebo"]
    seen = render_behind_glass(BOXES, POSE, camera.intrinsics())
    found, clean = sense(SENSORS["none"], seen, BOXES, POSE, camera, 1), cut_range(seen, camera)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(found, clean, strict=True))


def test_an_xtion_measures_the_same_bits_on_every_machine() -> None:
    model = SENSORS["xtion"]
    seen = render_behind_glass(BOXES, POSE, model.camera.intrinsics())
    depth_m = sense(model, seen, BOXES, POSE, model.camera, 2026).depth_m
    assert (
        hashlib.sha256(depth_m.tobytes()).hexdigest()
        == "bc7d17d28205540182c623b8c9a2464585b8b5e80a7f74e89fbb69d6f25721e0"
    )


@pytest.mark.parametrize("stage", ["second_view", "speckle", "grazing"])
def test_without_a_stage_that_loses_pixels_the_others_stay_the_same(stage: str) -> None:
    model, camera = small("xtion")
    pinhole = camera.intrinsics()
    seen = render_behind_glass(BOXES, POSE, pinhole)
    quiet = model.model_copy(update={"edges": None, "lateral": None})
    whole = distort(quiet, seen, BOXES, POSE, pinhole, 4).depth_m
    without = distort(quiet.model_copy(update={stage: None}), seen, BOXES, POSE, pinhole, 4).depth_m
    kept = ~np.isnan(whole)
    np.testing.assert_array_equal(whole[kept], without[kept])
    assert np.isnan(without).sum() < np.isnan(whole).sum()


def test_stages_lose_pixels_and_bring_none_back() -> None:
    model, camera = small("xtion")
    pinhole = camera.intrinsics()
    seen = render_behind_glass(BOXES, POSE, pinhole)
    hidden = distort(with_stages(model, "second_view"), seen, BOXES, POSE, pinhole, 4).depth_m
    everything = distort(model, seen, BOXES, POSE, pinhole, 4).depth_m
    assert np.isnan(hidden).any()
    assert np.isnan(everything[np.isnan(hidden)]).all()
    assert not np.isnan(everything).all()


def test_labels_move_with_measurements_at_ragged_edges() -> None:
    model = with_stages(SENSORS["xtion"], "lateral")
    boxes = [Box(Part.LEAF, (2.0, 5.0, 0.0), (0.02, 10.0, 20.0)), wall(3.0)]
    pinhole = cropped(model, 30, 200)
    ahead = CameraPose(0.0, 0.0, 0.0, 0.0)
    found = distort(model, render_behind_glass(boxes, ahead, pinhole), boxes, ahead, pinhole, 0)
    assert ((found.depth_m < 2.5) == (found.part == Part.LEAF)).all()
    assert ((found.part == Part.LEAF) == (found.box == 0)).all()
    leaf = (found.part == Part.LEAF).sum(axis=1)
    assert leaf.min() < 15 < leaf.max()


def test_glass_is_looked_through_or_gives_nothing() -> None:
    pane = Box(Part.LEAF, (2.0, 0.0, 0.0), (0.01, 1.0, 50.0), material="glass")
    boxes, model = [pane, wall(3.0)], with_stages(SENSORS["xtion"], "materials")
    image = measure_depth(model, boxes, cropped(model, 640, 480), [0])[0]
    before_pane = np.abs(np.arange(640) - 319.5) < 0.5 / 1.995 * model.camera.intrinsics().fx
    assert set(np.unique(image[~np.isnan(image)]).tolist()) == {3.0}
    assert not np.isnan(image[:, ~before_pane]).any()
    lost = np.isnan(image[:, before_pane])
    assert lost.mean() == pytest.approx(0.7, abs=0.03)
    # By patches: a pixel's neighbour shares its lot more often than by chance.
    assert lost[:, 1:][lost[:, :-1]].mean() > 0.9


def test_the_camera_of_deepdoors2_is_a_d435_that_was_turned() -> None:
    ours, turned = SENSORS["deepdoors2"].camera.intrinsics(), DEEPDOORS2.turned_clockwise()
    assert dataclasses.astuple(ours) == pytest.approx(dataclasses.astuple(turned), abs=1e-9)
    image = measure_depth(SENSORS["deepdoors2"], [wall(2.0)], ours, [0])[0]
    levels = image[~np.isnan(image)] * 16
    np.testing.assert_array_equal(levels, np.rint(levels))
    # The second imager is below, so the band without depth is above.
    assert np.isnan(image[:9]).all()
    assert np.isnan(image[11:]).mean() < 0.05


def test_a_closed_door_sinks_into_the_noise_with_distance() -> None:
    """The leaf lies flush with the wall face here; its casing stands 15 mm out of it."""
    model = SENSORS["xtion"]
    found = {}
    for distance_m in (1.0, 3.3):
        pose = CameraPose.from_degrees((0.0, distance_m, 1.2), -90.0, 0.0)
        boxes = scene_boxes(Scene(door=Door(), has_ceiling=False), Opening())
        seen = render_behind_glass(boxes, pose, model.camera.intrinsics())
        depth_m = distort(
            with_stages(model, "axial", "disparity_steps"), seen, boxes, pose, model.camera.intrinsics(), 0
        ).depth_m
        casing = (seen.part == Part.FRAME) & (np.abs(seen.depth_m - (distance_m - 0.015)) < 1e-3)
        leaf = (seen.part == Part.LEAF) & (np.abs(seen.depth_m - distance_m) < 1e-3)
        assert min(casing.sum(), leaf.sum()) > 500
        relief = depth_m[leaf].mean() - depth_m[casing].mean()
        assert relief == pytest.approx(0.015, abs=0.004)
        found[distance_m] = 0.015 / depth_m[leaf].std()
    assert found[1.0] > 5
    assert found[3.3] < 1


@pytest.mark.parametrize("name", ["gaussian:0.02", "gaussian:0"])
def test_a_gaussian_of_any_deviation_is_found(name: str) -> None:
    model = find_sensor(name)
    assert model.name == name
    image = measure_depth(model, [wall(2.0)], cropped(model, 160, 120), [0])
    assert image.std() == pytest.approx(float(name.partition(":")[2]), rel=0.03)


@pytest.mark.parametrize(
    "name", ["kinect2", "gaussian:", "gaussian:x", "gaussian:-1", "gaussian:nan", "xtion:2"]
)
def test_an_unknown_sensor_is_refused(name: str) -> None:
    with pytest.raises(ConfigError) as refused:
        find_sensor(name)
    assert refused.value.field == "sensor"


def test_models_are_settings_that_read_back_and_cannot_be_misspelt() -> None:
    for model in SENSORS.values():
        assert SensorModel.model_validate_json(model.model_dump_json()) == model
    with pytest.raises(ValidationError, match="baseline"):
        SensorModel.model_validate({"name": "mine", "second_view": {"baseline": 0.1}})


def test_a_scene_without_anything_gives_nothing_and_no_warning() -> None:
    for model in SENSORS.values():
        pinhole = cropped(model, 12, 8)
        empty = render_behind_glass([], POSE, pinhole)
        assert not np.isfinite(distort(model, empty, [], POSE, pinhole, 0).depth_m).any()
        nothing = Render(np.full_like(empty.depth_m, np.nan), empty.part, empty.box)
        assert np.isnan(distort(model, nothing, [], POSE, pinhole, 0).depth_m).all()
