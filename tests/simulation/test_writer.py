# SPDX-License-Identifier: Apache-2.0
"""Simulated folders: their files, and resumption of a killed simulation to the same manifest."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.dataset.frame_index import IndexedOptions
from doorstate.dataset.labelled import labelled_frames
from doorstate.errors import ConfigError, DatasetError
from doorstate.io.options import ReadOptions
from doorstate.io.readers import read_cloud
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import RAW_KINDS, SimulationSettings
from doorstate.simulation.writer import is_simulated, read_settings, simulate_dataset
from doorstate.types import STATES
from tests.error_fields import about

SCRIPT = """
import sys
from pathlib import Path

from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset

if __name__ == "__main__":
    settings = SimulationSettings.model_validate_json(Path(sys.argv[2]).read_text(encoding="utf-8"))
    simulate_dataset(Path(sys.argv[1]), settings, workers=2)
"""


def settings_of(poses: int, width: int = 80, height: int = 60, seed: int = 4) -> SimulationSettings:
    preset = PRESETS["ogurob"].model_copy(update={"camera": DepthCamera(width=width, height=height)})
    return SimulationSettings(preset=preset, seed=seed, poses=poses)


def test_the_manifest_has_three_states_per_pose(tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    rows = simulate_dataset(tmp_path / "data", settings_of(10), 1, lambda *step: steps.append(step))
    assert steps == [(0, 2), (1, 2), (2, 2)]
    assert [(row["pose_id"], row["state"]) for row in rows] == [
        (f"p{index:04d}", state) for index in PRESETS["ogurob"].indices(10) for state in STATES
    ]
    assert sorted(path.name for path in (tmp_path / "data").iterdir()) == [MANIFEST_FILE, "simulation.json"]
    assert is_simulated(tmp_path / "data")
    assert read_settings(tmp_path / "data") == settings_of(10)
    steps.clear()
    assert simulate_dataset(tmp_path / "data", settings_of(10), 1, lambda *step: steps.append(step)) == rows
    assert steps == [(1, 1)]


def test_raw_files_are_written_on_request(tmp_path: Path) -> None:
    settings = SimulationSettings(preset=PRESETS["ogurob"], seed=1, poses=1, raw=RAW_KINDS)
    for line in simulate_dataset(tmp_path, settings, 1):
        row = unflatten(line)
        frame = replay(row)
        cloud = tmp_path / "pcd" / row.state / f"{row.sample_id}.pcd"
        np.testing.assert_array_equal(read_cloud(cloud), frame.points)
        header = cloud.read_bytes()[:400]
        assert b"WIDTH 640\n" in header
        assert b"HEIGHT 480\n" in header
        depth = tmp_path / "depth" / row.state / f"{row.sample_id}.png"
        points = read_cloud(depth, ReadOptions(intrinsics=row.camera.intrinsics()))
        assert np.nanmax(np.abs(points[..., 0] - frame.cut.depth_m)) <= 0.5001e-3
        np.testing.assert_array_equal(np.isnan(points[..., 0]), np.isnan(frame.cut.depth_m))
        with Image.open(tmp_path / "image" / row.state / f"{row.sample_id}.png") as picture:
            assert (picture.size, picture.mode) == ((640, 480), "RGB")
    assert len(list(tmp_path.rglob("*.p[cn][dg]"))) == 9


def test_depth_images_are_read_as_they_were_rendered_by_the_index_beside_them(tmp_path: Path) -> None:
    settings = SimulationSettings(preset=PRESETS["varied"], seed=1, poses=1, raw=("depth",))
    rows = [unflatten(line) for line in simulate_dataset(tmp_path, settings, 1)]
    assert all(row.pitch_deg and row.roll_deg for row in rows)
    by_file = {frame.file: frame for frame in labelled_frames(tmp_path / "depth")}
    indexed = IndexedOptions(ReadOptions())
    for row in rows:
        frame = replay(row)
        labelled = by_file[f"{row.state}/{row.sample_id}.png"]
        points = read_cloud(labelled.folder / labelled.file, indexed.of(labelled.folder / labelled.file))
        np.testing.assert_array_equal(points, labelled.read().points)
        assert labelled.label == row.state
        assert np.nanmax(np.abs(points - frame.points)) < 1.5e-3  # of depth that is rounded to 1 mm


def test_a_stopped_simulation_continues_with_the_missing_pieces(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    whole = simulate_dataset(tmp_path / "undisturbed", settings_of(20), 1)

    def stop_after_two(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_dataset(folder, settings_of(20), 1, stop_after_two)
    pieces = sorted((folder / "pieces").iterdir())
    assert [piece.name for piece in pieces] == ["00000.csv", "00001.csv"]
    pieces[0].unlink()
    steps: list[tuple[int, int]] = []
    assert simulate_dataset(folder, settings_of(20), 1, lambda *step: steps.append(step)) == whole
    assert steps == [(1, 3), (2, 3), (3, 3)]
    assert (folder / MANIFEST_FILE).read_bytes() == (tmp_path / "undisturbed" / MANIFEST_FILE).read_bytes()
    assert not (folder / "pieces").exists()


def test_pieces_beside_a_complete_manifest_are_removed(tmp_path: Path) -> None:
    rows = simulate_dataset(tmp_path, settings_of(1), 1)
    (tmp_path / "pieces").mkdir()
    (tmp_path / "pieces" / "00000.csv").write_text("old", encoding="utf-8")
    assert simulate_dataset(tmp_path, settings_of(1), 1) == rows
    assert not (tmp_path / "pieces").exists()


def test_a_killed_simulation_continues_and_leaves_no_worker(tmp_path: Path) -> None:
    settings = settings_of(48, width=320, height=240)
    script, options, folder = tmp_path / "simulate.py", tmp_path / "options.json", tmp_path / "data"
    script.write_text(SCRIPT, encoding="utf-8")
    options.write_text(settings.model_dump_json(), encoding="utf-8")
    with subprocess.Popen([sys.executable, script, folder, options], stdout=subprocess.PIPE) as parent:
        waited_until = time.monotonic() + 60
        while not list(folder.glob("pieces/[0-9]*.csv")):
            assert parent.poll() is None
            assert time.monotonic() < waited_until
            time.sleep(0.005)
        parent.send_signal(signal.SIGKILL)
        # Workers inherited the pipe: it ends when the last of them has.
        parent.communicate(timeout=30)
    assert not (folder / MANIFEST_FILE).exists()
    finished = len(list(folder.glob("pieces/[0-9]*.csv")))
    assert 1 <= finished < 6
    steps: list[tuple[int, int]] = []
    simulate_dataset(folder, settings, 1, lambda *step: steps.append(step))
    assert steps[0] == (finished, 6)
    simulate_dataset(tmp_path / "undisturbed", settings, 1)
    assert (folder / MANIFEST_FILE).read_bytes() == (tmp_path / "undisturbed" / MANIFEST_FILE).read_bytes()


def test_a_folder_with_other_contents_is_refused(tmp_path: Path) -> None:
    simulate_dataset(tmp_path / "data", settings_of(1), 1)
    for changed in (settings_of(2), settings_of(1, seed=5), settings_of(1, width=81)):
        with pytest.raises(ConfigError, check=about(tmp_path / "data")):
            simulate_dataset(tmp_path / "data", changed, 1)
    with pytest.raises(ConfigError, check=about(tmp_path)):
        simulate_dataset(tmp_path, settings_of(1), 1)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, check=about(tmp_path / "file")):
        simulate_dataset(tmp_path / "file", settings_of(1), 1)
    (tmp_path / "empty").mkdir()
    assert len(simulate_dataset(tmp_path / "empty", settings_of(1), 1)) == 3


def test_missing_or_damaged_settings_are_refused_with_their_path(tmp_path: Path) -> None:
    with pytest.raises(DatasetError) as missing:
        read_settings(tmp_path)
    assert missing.value.path == tmp_path
    for text in ('{"seed": 1', '{"preset": {"name": "colourful"}, "seed": 1}'):
        (tmp_path / "simulation.json").write_text(text, encoding="utf-8")
        with pytest.raises(DatasetError) as damaged:
            read_settings(tmp_path)
        assert damaged.value.path == tmp_path / "simulation.json"
        assert "\n" not in str(damaged.value)
