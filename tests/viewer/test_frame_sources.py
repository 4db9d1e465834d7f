# SPDX-License-Identifier: Apache-2.0
"""Frames of folders and bags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate.dataset.frame_labels import DoorLabel, LabelIndex
from doorstate.dataset.labelled import labelled_frames
from doorstate.errors import CloudReadError
from doorstate.io.bags import Bag
from doorstate.io.camera import Intrinsics
from doorstate.io.options import ReadOptions
from doorstate.simulation.frames import Frame
from doorstate.viewer.frame_sources import BagFrames, FolderFrames, option_columns
from tests.hand_made_clouds import image_of_a_rough_wall
from tests.viewer.labelling import FILES, OPTIONS, write_depth_images

CLOUDS = [image_of_a_rough_wall(20, 25) * (1 + k / 10) for k in range(5)]


def test_folder_is_read_as_its_index_tells(frames: list[Frame], tmp_path: Path) -> None:
    folder = write_depth_images(tmp_path, frames)
    source = FolderFrames(folder, OPTIONS)
    assert source.names == FILES
    columns = source.keep(0)
    assert (columns["rgb"], columns["width"], columns["pitch_deg"]) == ("1_closed_rgb.jpg", "320", "0")
    assert source.colour(1) is None
    # Evaluation reads the frames without the options.
    LabelIndex(folder).replace(FILES[0], (DoorLabel("closed"),), "", columns)
    (frame,) = labelled_frames(folder)
    np.testing.assert_array_equal(frame.read().points, source.read(0).points)
    assert FolderFrames(folder, ReadOptions(), every=3).names == [FILES[0], FILES[3]]


def test_index_names_the_colour_image_inside_the_folder(frames: list[Frame], tmp_path: Path) -> None:
    folder = write_depth_images(tmp_path / "in", frames)
    (folder / "rgb").mkdir()
    text = f"file,state,rgb\n{FILES[0]},,rgb/a.jpg\n{FILES[1]},,../a.jpg\n"
    (folder / "index.csv").write_text(text, encoding="utf-8")
    source = FolderFrames(folder, OPTIONS)
    assert source.colour(0) == folder / "rgb" / "a.jpg"
    assert source.colour(1) is None


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_labelled_messages_of_a_bag_become_files(kind: str, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from tests.bag_writer import START_NS, cloud, write_bag

    messages = [cloud("/points", points, START_NS + k * 10**9) for k, points in enumerate(CLOUDS)]
    bag = write_bag(tmp_path / "bag", kind, messages)
    out = tmp_path / "labels"
    source = BagFrames(bag, out, ReadOptions(camera_height_m=1.1), every=2)
    assert source.names == ["frame-000000.npz", "frame-000002.npz", "frame-000004.npz"]
    for number in (0, 1, 2, 0, 2, 1, 1):
        np.testing.assert_array_equal(source.read(number).points, CLOUDS[2 * number])
    assert source.keep(1) == {"topic": "/points", "stamp_s": "1700000002.000000", "camera_height_m": "1.1"}
    assert [path.name for path in out.iterdir()] == ["frame-000002.npz"]
    LabelIndex(out).replace(source.names[1], (DoorLabel("open"),), "", source.keep(1))
    np.testing.assert_array_equal(labelled_frames(out)[0].read().points, CLOUDS[2])
    source.close()
    level = BagFrames(bag, out, ReadOptions(pitch_deg=10.0))
    assert (level.keep(1)["pitch_deg"], level.keep(1)["roll_deg"]) == ("0", "0")
    level.close()
    with pytest.raises(CloudReadError):
        BagFrames(bag, out, ReadOptions(), topic="/other")


def test_a_bag_is_read_once_while_frames_are_labelled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rosbags")
    from tests.bag_writer import START_NS, cloud, write_bag

    messages = [cloud("/points", CLOUDS[0], START_NS + k * 10**9) for k in range(20)]
    bag = write_bag(tmp_path / "bag", "mcap", messages)
    source = BagFrames(bag, tmp_path / "labels", ReadOptions())
    starts: list[int] = []
    clouds = Bag.clouds

    def counted(self: Bag, *arguments: object) -> object:
        starts.append(int(str(arguments[-1])))
        return clouds(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Bag, "clouds", counted)
    for number in range(5, 15):
        source.read(number + 1)  # ahead
        source.keep(number)
    assert starts == [6, 5, 7]
    source.close()


def test_options_as_columns() -> None:
    assert option_columns(ReadOptions()) == {}
    options = ReadOptions(
        intrinsics=Intrinsics(8, 6, 500.25, 501, 4, 3),
        depth_scale_m=0.00025,
        axes="optical",
        roll_deg=2.5,
        camera_height_m=0.3,
    )
    assert option_columns(options) == {
        "fx": "500.25",
        "fy": "501",
        "cx": "4",
        "cy": "3",
        "width": "8",
        "height": "6",
        "depth_unit_m": "0.00025",
        "axes": "optical",
        "roll_deg": "2.5",
        "camera_height_m": "0.3",
    }
    assert option_columns(ReadOptions(quaternion=(0, 0, 0, 1))) == {"quaternion": "0 0 0 1"}
