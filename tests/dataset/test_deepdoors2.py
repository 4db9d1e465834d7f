# SPDX-License-Identifier: Apache-2.0
"""DeepDoors2: simulated doors recorded by a turned camera are read upright."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.deepdoors2 import CAMERA, deepdoors2_rows, read_deepdoors2
from doorstate.dataset.layouts import LAYOUTS, find_layout
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.errors import CameraError, CloudReadError, ConfigError, DatasetError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.options import ReadOptions
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.render import render
from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes
from doorstate.types import Part
from tests.error_fields import about

Run = Callable[..., tuple[int, str, str]]
STEP_M = 0.0625
HEIGHT_M = 1.1
# 2.5 m before the wall, looking straight at it, turned by 90 degrees as the authors' camera was.
POSE = CameraPose.from_degrees((0.1, 2.5, HEIGHT_M), -90, 0, 90)


def recorded(opening_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """(480, 640) depth in metres, NaN beyond 10 m, and parts, of a door in front of the turned camera."""
    frame = render(
        scene_boxes(Scene(door=Door(), has_ceiling=False), Opening(angle_deg=opening_deg)), POSE, CAMERA
    )
    return np.where(frame.depth_m < 10, frame.depth_m, np.nan), frame.part


def write(path: Path, depth_m: np.ndarray, mode: str = "L") -> Path:
    """Write a depth image as published: turned upright, 8 bit, in steps of 1/16 m."""
    path.parent.mkdir(parents=True, exist_ok=True)
    steps = np.nan_to_num(np.rint(depth_m / STEP_M)).astype(np.uint8)
    Image.fromarray(np.ascontiguousarray(np.rot90(steps, -1))).convert(mode).save(path)
    return path


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "DeepDoors2"
    closed, opened = recorded(1)[0], recorded(88)[0]
    kinds = folder / "Door Classification"
    for split in ("Train", "Val", "Test"):
        write(kinds / "Depth" / split / "Closed" / "Door1.png", closed)
        write(kinds / "Depth" / split / "Open" / "Door2.png", opened)
        write(kinds / "Depth" / split / "Semi-open" / "Door3.png", recorded(40)[0])
        write(kinds / "RGB" / split / "Closed" / "Door1.png", closed, "RGB")
    write(kinds / "Depth" / "Test" / "Open" / "Door2(1).png", opened)
    write(folder / "Door Detection" / "Annotations" / "Test" / "Door1.png", closed, "RGB")
    return folder


@pytest.mark.parametrize("opening_deg", [1, 88])
def test_a_door_of_the_turned_camera_is_upright_at_its_distance(opening_deg: float, tmp_path: Path) -> None:
    depth_m, part = recorded(opening_deg)
    points = read_deepdoors2(write(tmp_path / "door.png", depth_m), ReadOptions())
    assert points.shape == (640, 480, 3)
    part = np.rot90(part, -1)
    wall, floor, leaf = (
        points[(part == label) & np.isfinite(points[..., 0])] for label in (Part.WALL, Part.FLOOR, Part.LEAF)
    )
    assert np.abs(wall[:, 0] - 2.5).max() <= STEP_M / 2 + 1e-6
    # A step of depth moves a point of the floor along its ray, which falls by at most 320 / 384.681.
    assert np.abs(floor[:, 2] + HEIGHT_M).max() <= STEP_M / 2 * 320 / 384.681 + 0.01
    assert leaf[:, 2].min() == pytest.approx(-HEIGHT_M, abs=0.06)
    assert leaf[:, 2].max() == pytest.approx(Door().opening_height_m - HEIGHT_M, abs=0.08)
    # Closed, the leaf lies in the wall; open, it reaches its width towards the camera, which stands at x = 0.1.
    reach_m = 2.5 - leaf[:, 0].min()
    if opening_deg < 45:
        assert reach_m < 0.1
        assert leaf[:, 1].max() - leaf[:, 1].min() == pytest.approx(Door().opening_width_m, abs=0.08)
        # The camera looks along -y of the door frame, so its left is the door's +x.
        assert (leaf[:, 1].max() + leaf[:, 1].min()) / 2 == pytest.approx(-0.1, abs=0.03)
    else:
        assert reach_m == pytest.approx(Door().opening_width_m, abs=0.1)


def test_every_pixel_equals_the_point_of_the_turned_camera(tmp_path: Path) -> None:
    depth_m, _ = recorded(40)
    rounded_m = np.rint(depth_m / STEP_M) * STEP_M
    ours = read_deepdoors2(write(tmp_path / "door.png", depth_m), ReadOptions())
    as_built = depth_to_points(rounded_m, CAMERA, roll_deg=90)
    np.testing.assert_allclose(ours, np.rot90(as_built, -1), atol=1e-5)


def test_images_as_the_turned_camera_recorded_them_are_turned(tmp_path: Path) -> None:
    upright = write(tmp_path / "upright.png", recorded(40)[0])
    lying = tmp_path / "lying.png"
    with Image.open(upright) as image:
        image.transpose(Image.Transpose.ROTATE_90).save(lying)
    np.testing.assert_array_equal(
        read_deepdoors2(upright, ReadOptions()), read_deepdoors2(lying, ReadOptions())
    )


def test_unmeasured_and_clipped_pixels_are_no_points(tmp_path: Path) -> None:
    pixels = np.full((640, 480), 32, np.uint8)
    pixels[0], pixels[1] = 0, 255
    Image.fromarray(pixels).save(tmp_path / "a.png")
    points = read_deepdoors2(tmp_path / "a.png", ReadOptions())
    assert np.isnan(points[:2]).all()
    assert (points[2:, :, 0] == 2.0).all()  # the README's own example: 32 is 2 m


def test_other_intrinsics_replace_the_published_ones(tmp_path: Path) -> None:
    path = write(tmp_path / "door.png", recorded(1)[0])
    published = read_deepdoors2(path, ReadOptions())
    longer = read_deepdoors2(
        path, ReadOptions(intrinsics=Pinhole(2 * CAMERA.fx, 2 * CAMERA.fy, CAMERA.cx, CAMERA.cy))
    )
    np.testing.assert_allclose(longer[..., 1:], published[..., 1:] / 2, atol=1e-6)
    with pytest.raises(CameraError, match=r"the image has 480 x 640 pixels"):
        read_deepdoors2(path, ReadOptions(intrinsics=Intrinsics(800, 600, 400, 400, 400, 300)))


def test_grey_images_stored_as_colour_are_read_and_colour_images_refused(tmp_path: Path) -> None:
    grey = write(tmp_path / "grey.png", recorded(1)[0])
    as_colour = write(tmp_path / "colour.png", recorded(1)[0], "RGB")
    np.testing.assert_array_equal(
        read_deepdoors2(grey, ReadOptions()), read_deepdoors2(as_colour, ReadOptions())
    )
    Image.new("RGB", (480, 640), (1, 2, 3)).save(tmp_path / "photo.png")
    with pytest.raises(CloudReadError, check=about(tmp_path / "photo.png")):
        read_deepdoors2(tmp_path / "photo.png", ReadOptions())
    Image.fromarray(np.ones((640, 480), np.uint16)).save(tmp_path / "deep.png")
    with pytest.raises(CloudReadError, check=about(tmp_path / "deep.png")):
        read_deepdoors2(tmp_path / "deep.png", ReadOptions())
    with pytest.raises(CloudReadError, check=about(tmp_path / "none.png")):
        read_deepdoors2(tmp_path / "none.png", ReadOptions())


def test_depth_images_are_listed_once_with_their_state_and_split(root: Path) -> None:
    rows = deepdoors2_rows(root)
    assert {(row["split"], row["state"]) for row in rows} == {
        (split, state) for split in ("train", "val", "test") for state in ("closed", "semi_open", "open")
    }
    assert len(rows) == 9
    assert all(row["file"].startswith("Door Classification/Depth/") for row in rows)
    part = root / "Door Classification" / "Depth" / "Test"
    assert [(row["file"], row["split"]) for row in deepdoors2_rows(part)] == [
        ("Closed/Door1.png", "test"),
        ("Open/Door2.png", "test"),
        ("Semi-open/Door3.png", "test"),
    ]


def test_cropped_images_of_the_predecessor_are_skipped(tmp_path: Path) -> None:
    image = recorded(1)[0]
    base = tmp_path / "Door Classification"
    write(base / "OriginalSize" / "Depth" / "Train" / "Semi" / "1.png", image)
    write(base / "Cropped" / "Depth" / "Train" / "Semi" / "1.png", image[100:300])
    assert [(row["file"], row["state"]) for row in deepdoors2_rows(tmp_path)] == [
        ("Door Classification/OriginalSize/Depth/Train/Semi/1.png", "semi_open")
    ]


def test_other_folders_are_refused(root: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no depth images"):
        deepdoors2_rows(root / "Door Classification" / "RGB")
    with pytest.raises(DatasetError, check=about(tmp_path / "nowhere")):
        deepdoors2_rows(tmp_path / "nowhere")
    with pytest.raises(ConfigError, match="kitti") as refused:
        find_layout("kitti")
    assert refused.value.field == "layout"
    assert list(LAYOUTS) == ["deepdoors2"]


def test_prepare_takes_the_layout(root: Path, tmp_path: Path, run: Run) -> None:
    part, out = root / "Door Classification" / "Depth" / "Test", tmp_path / "p"
    command = ("prepare", part, "--layout", "deepdoors2", "--points", 128, "--workers", 1)
    code, out_text, err = run(*command, "--out", out)
    assert (code, err) == (0, "")
    assert "3 clouds of 128 points" in out_text
    again = prepare_dataset(
        Preparation(part, CloudSpec(num_points=128), layout="deepdoors2"), out, workers=1
    ).dataset
    assert [(row["state"], row["split"]) for row in again.rows] == [
        ("closed", "test"),
        ("open", "test"),
        ("semi_open", "test"),
    ]
    assert np.linalg.norm(again.clouds[0], axis=1).max() < 15
    code, _, err = run(*command, "--roll", 90, "--out", tmp_path / "q")
    assert code == 2
    assert "--layout" in err
    # Without the layout it is a different preparation.
    assert "something else" in run("prepare", part, "--points", 128, "--out", out)[2]


def test_evaluate_takes_the_layout(root: Path, run: Run) -> None:
    part = root / "Door Classification" / "Depth" / "Test"
    code, out, err = run(
        "evaluate", part, "--layout", "deepdoors2", "--rule", "plane_state", "--by", "split", "--json"
    )
    assert (code, err) == (0, "")
    metrics = json.loads(out)
    assert metrics["states"] == {"closed": 1, "semi_open": 1, "open": 1}
    (stratum,) = (row for row in metrics["strata"]["split"] if row["method"] == "plane_state")
    assert (stratum["value"], stratum["frames"]) == ("test", 3)
    # A rule that measures angles needs doors that are upright and in true proportion.
    (score,) = (row for row in metrics["scores"] if row["method"] == "plane_state")
    assert score["correct"] >= 2
