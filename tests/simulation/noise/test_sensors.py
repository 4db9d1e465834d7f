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
from doorstate.simulation.noise.model import Model, SensorModel, distort, sense
from doorstate.simulation.noise.sensors import SENSORS, STAGE_SENSORS, find_sensor
from doorstate.simulation.render import NO_BOX, cut_range, render_behind_glass
from doorstate.simulation.scene import Box, Door, Opening, Scene, scene_boxes
from doorstate.types import Part

POSE = CameraPose.from_degrees((0.4, 2.2, 1.0), -97.0, 3.0)
# With the hinge on the right, the leaf's free edge is its left one, where shadows fall on the surfaces behind.
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


def test_models_agree_with_published_values_within_ten_per_cent(checks: list[SensorResult]) -> None:
    apart = {(row.sensor, row.quantity, row.condition): row.measured / row.published - 1 for row in checks}
    assert len(apart) == len(checks) > 60
    assert {measure: error for measure, error in apart.items() if not abs(error) < 0.1} == {}
    assert {row.sensor for row in checks} == set(STAGE_SENSORS) - {"none"}
    assert len(sensors_table(checks).rows) == len(checks)


def test_axial_noise_and_steps_equal_the_table(checks: list[SensorResult]) -> None:
    measured = {(row.sensor, row.quantity, row.condition): row.measured for row in checks}
    assert set(TABLE_MM) == set(STAGE_SENSORS) - {"none"}
    for name, line in TABLE_MM.items():
        for depth_m, sigma_mm in line.items():
            assert PUBLISHED_SIGMA_M[name](depth_m) * 1000 == pytest.approx(sigma_mm, abs=0.1)
            assert measured[name, "axial noise", f"{depth_m:g} m"] == pytest.approx(sigma_mm, rel=0.1)
    for depth_m, step_mm in STEPS_MM.items():
        assert measured["xtion", "step of disparity", f"{depth_m:g} m"] == pytest.approx(step_mm, rel=0.1)


def small(name: str) -> tuple[Model, DepthCamera]:
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
def test_a_measurement_depends_on_its_seed(name: str) -> None:
    model, camera = small(name)
    rendered = render_behind_glass(BOXES, POSE, camera.intrinsics())
    before = [image.copy() for image in rendered[:3]]
    first, again, different = (sense(model, rendered, BOXES, POSE, camera, seed) for seed in (5, 5, 6))
    assert all(np.array_equal(a, b) for a, b in zip(before, rendered[:3], strict=True))
    assert all(
        a.tobytes() == b.tobytes() and a.dtype == b.dtype for a, b in zip(first[:3], again[:3], strict=True)
    )
    assert (first.depth_m.tobytes() == different.depth_m.tobytes()) == (name == "none")
    lost = np.isnan(first.depth_m)
    assert ((first.part == Part.NONE) == lost).all()
    assert ((first.box == NO_BOX) == lost).all()
    with np.errstate(invalid="ignore"):
        assert ((first.depth_m > camera.min_depth_m) & (first.depth_m < camera.max_depth_m) | lost).all()


def test_the_sensor_none_keeps_the_rendering_bit_for_bit() -> None:
    camera = CAMERAS["xtion-gazebo"]
    rendered = render_behind_glass(BOXES, POSE, camera.intrinsics())
    result, clean = sense(SENSORS["none"], rendered, BOXES, POSE, camera, 1), cut_range(rendered, camera)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(result[:3], clean[:3], strict=True))


def test_an_xtion_measurement_has_the_same_bits_on_every_machine() -> None:
    model = SENSORS["xtion"]
    rendered = render_behind_glass(BOXES, POSE, model.camera.intrinsics())
    depth_m = sense(model, rendered, BOXES, POSE, model.camera, 2026).depth_m
    assert (
        hashlib.sha256(depth_m.tobytes()).hexdigest()
        == "bc7d17d28205540182c623b8c9a2464585b8b5e80a7f74e89fbb69d6f25721e0"
    )


@pytest.mark.parametrize("stage", ["second_view", "speckle", "grazing"])
def test_leaving_out_a_stage_does_not_change_the_others(stage: str) -> None:
    model, camera = STAGE_SENSORS["xtion"], small("xtion")[1]
    pinhole = camera.intrinsics()
    rendered = render_behind_glass(BOXES, POSE, pinhole)
    quiet = model.model_copy(update={"edges": None, "lateral": None})
    whole = distort(quiet, rendered, BOXES, POSE, pinhole, 4).depth_m
    without = distort(quiet.model_copy(update={stage: None}), rendered, BOXES, POSE, pinhole, 4).depth_m
    kept = ~np.isnan(whole)
    np.testing.assert_array_equal(whole[kept], without[kept])
    assert np.isnan(without).sum() < np.isnan(whole).sum()


def test_lost_pixels_stay_lost() -> None:
    model, camera = STAGE_SENSORS["xtion"], small("xtion")[1]
    pinhole = camera.intrinsics()
    rendered = render_behind_glass(BOXES, POSE, pinhole)
    hidden = distort(with_stages(model, "second_view"), rendered, BOXES, POSE, pinhole, 4).depth_m
    everything = distort(model, rendered, BOXES, POSE, pinhole, 4).depth_m
    assert np.isnan(hidden).any()
    assert np.isnan(everything[np.isnan(hidden)]).all()
    assert not np.isnan(everything).all()


def test_parts_move_with_depth_at_ragged_edges() -> None:
    model = with_stages(STAGE_SENSORS["xtion"], "lateral")
    boxes = [Box(Part.LEAF, (2.0, 5.0, 0.0), (0.02, 10.0, 20.0)), wall(3.0)]
    pinhole = cropped(model, 30, 200)
    ahead = CameraPose(0.0, 0.0, 0.0, 0.0)
    measured = distort(model, render_behind_glass(boxes, ahead, pinhole), boxes, ahead, pinhole, 0)
    assert ((measured.depth_m < 2.5) == (measured.part == Part.LEAF)).all()
    assert ((measured.part == Part.LEAF) == (measured.box == 0)).all()
    leaf = (measured.part == Part.LEAF).sum(axis=1)
    assert leaf.min() < 15 < leaf.max()


def test_glass_is_transparent_or_lost() -> None:
    pane = Box(Part.LEAF, (2.0, 0.0, 0.0), (0.01, 1.0, 50.0), material="glass")
    boxes, model = [pane, wall(3.0)], with_stages(STAGE_SENSORS["xtion"], "materials")
    image = measure_depth(model, boxes, cropped(model, 640, 480), [0])[0]
    before_pane = np.abs(np.arange(640) - 319.5) < 0.5 / 1.995 * model.camera.intrinsics().fx
    assert set(np.unique(image[~np.isnan(image)]).tolist()) == {3.0}
    assert not np.isnan(image[:, ~before_pane]).any()
    lost = np.isnan(image[:, before_pane])
    assert lost.mean() == pytest.approx(0.7, abs=0.03)
    # In patches: neighbouring pixels are lost together more often than by chance.
    assert lost[:, 1:][lost[:, :-1]].mean() > 0.9


def test_the_camera_of_deepdoors2_is_a_turned_d435() -> None:
    ours, turned = SENSORS["deepdoors2"].camera.intrinsics(), DEEPDOORS2.turned_clockwise()
    assert dataclasses.astuple(ours) == pytest.approx(dataclasses.astuple(turned), abs=1e-9)
    image = measure_depth(SENSORS["deepdoors2"], [wall(2.0)], ours, [0])[0]
    levels = image[~np.isnan(image)] * 16
    np.testing.assert_array_equal(levels, np.rint(levels))
    # The second imager is below, so the band without depth is at the top.
    assert np.isnan(image[:9]).all()
    assert np.isnan(image[11:]).mean() < 0.05


def test_the_relief_of_a_closed_door_disappears_in_noise_with_distance() -> None:
    """The leaf is flush with the wall face; its casing projects 15 mm."""
    model = STAGE_SENSORS["xtion"]
    relief_to_noise = {}
    for distance_m in (1.0, 3.3):
        pose = CameraPose.from_degrees((0.0, distance_m, 1.2), -90.0, 0.0)
        boxes = scene_boxes(Scene(door=Door(), has_ceiling=False), Opening())
        rendered = render_behind_glass(boxes, pose, model.camera.intrinsics())
        depth_m = distort(
            with_stages(model, "axial", "disparity_steps"),
            rendered,
            boxes,
            pose,
            model.camera.intrinsics(),
            0,
        ).depth_m
        casing = (rendered.part == Part.FRAME) & (np.abs(rendered.depth_m - (distance_m - 0.015)) < 1e-3)
        leaf = (rendered.part == Part.LEAF) & (np.abs(rendered.depth_m - distance_m) < 1e-3)
        assert min(casing.sum(), leaf.sum()) > 500
        relief = depth_m[leaf].mean() - depth_m[casing].mean()
        assert relief == pytest.approx(0.015, abs=0.004)
        relief_to_noise[distance_m] = 0.015 / depth_m[leaf].std()
    assert relief_to_noise[1.0] > 5
    assert relief_to_noise[3.3] < 1


@pytest.mark.parametrize("name", ["gaussian:0.02", "gaussian:0"])
def test_a_gaussian_sensor_has_the_deviation_in_its_name(name: str) -> None:
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


def test_models_read_back_from_json_and_misspelt_settings_are_refused() -> None:
    for model in SENSORS.values():
        assert type(model).model_validate_json(model.model_dump_json()) == model
    with pytest.raises(ValidationError, match="baseline"):
        SensorModel.model_validate({"name": "mine", "second_view": {"baseline": 0.1}})


def test_an_empty_scene_gives_no_depth_and_no_warning() -> None:
    for model in SENSORS.values():
        pinhole = cropped(model, 12, 8)
        empty = render_behind_glass([], POSE, pinhole)
        assert not np.isfinite(distort(model, empty, [], POSE, pinhole, 0).depth_m).any()
        nothing = empty._replace(depth_m=np.full_like(empty.depth_m, np.nan))
        assert np.isnan(distort(model, nothing, [], POSE, pinhole, 0).depth_m).all()
