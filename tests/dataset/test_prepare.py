# SPDX-License-Identifier: Apache-2.0
"""Preparation end to end: clouds equal those of their rows, also after interruptions."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import read_csv, write_csv
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.dataset import prepare
from doorstate.dataset.description import DESCRIPTION_FILE
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import REJECTED, prepare_dataset
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, open_dataset
from doorstate.dataset.strata import distance_band, region
from doorstate.errors import ConfigError, DatasetError
from doorstate.io.options import ReadOptions
from doorstate.io.pcd import write_pcd
from doorstate.io.readers import read_cloud
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
from doorstate.types import STATES, Part
from tests.error_fields import about

NUM_POINTS = 256
SPEC = CloudSpec(num_points=NUM_POINTS)
FILES = (MANIFEST_FILE, CLOUDS_FILE, PARTS_FILE, DESCRIPTION_FILE, "preparation.json")


@pytest.fixture
def four_samples_a_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "_SAMPLES_PER_PIECE", 4)


@pytest.fixture(scope="module")
def undisturbed(tiny_simulation: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("prepared") / "doors"
    prepare_dataset(Preparation(tiny_simulation, SPEC), folder, workers=1)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_data_set_without_clouds_renders_them_from_its_rows(undisturbed: Path, tmp_path: Path) -> None:
    stored = open_dataset(undisturbed)
    shutil.copy(undisturbed / MANIFEST_FILE, tmp_path)
    stored.description.model_copy(update={"clouds": "replayed"}).save(tmp_path)
    rows = open_dataset(tmp_path)
    np.testing.assert_array_equal(rows.cloud(4, 20), stored.cloud(4)[:20])
    np.testing.assert_array_equal(rows.cloud(4), stored.cloud(4))
    np.testing.assert_array_equal(rows.parts(4, 30), stored.parts(4, 30))
    with pytest.raises(DatasetError, check=about(tmp_path)):
        _ = rows.clouds
    (raw,) = rows.raw_clouds(1)
    np.testing.assert_array_equal(raw, replay(unflatten(rows.rows[0])).points)
    raw[:] = 0
    np.testing.assert_array_equal(rows.raw_cloud(0), replay(unflatten(rows.rows[0])).points)


def test_the_cache_of_replayed_clouds_is_bounded(
    undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = open_dataset(undisturbed)
    shutil.copy(undisturbed / MANIFEST_FILE, tmp_path)
    stored.description.model_copy(update={"clouds": "replayed"}).save(tmp_path)
    rows = open_dataset(tmp_path)
    monkeypatch.setattr("doorstate.dataset.store._CACHED_CLOUDS", 2)
    for index in (0, 1, 2, 1, 0):
        np.testing.assert_array_equal(rows.cloud(index), stored.cloud(index))
        assert len(rows._sampled) <= 2


def test_clouds_and_parts_equal_those_of_the_replayed_rows(tiny_simulation: Path, tmp_path: Path) -> None:
    dataset, rejected = prepare_dataset(Preparation(tiny_simulation, SPEC), tmp_path / "doors", workers=1)
    assert rejected == []
    assert (len(dataset), dataset.num_points, dataset.clouds.shape) == (15, NUM_POINTS, (15, NUM_POINTS, 3))
    assert (dataset.description.kind, dataset.description.source) == ("simulated", "ogurob")
    assert sorted(contents(tmp_path / "doors")) == sorted(FILES)
    for index, row in enumerate(dataset.rows):
        sample = unflatten(row)
        frame = replay(sample)
        points, raw_rows = prepare_cloud(frame.points, SPEC)
        np.testing.assert_array_equal(dataset.cloud(index), points)
        np.testing.assert_array_equal(dataset.parts(index), frame.cut.part.reshape(-1)[raw_rows])
        assert (dataset.parts(index) != Part.NONE).all()
        assert row["distance_band"] == distance_band(sample.distance_m)
        assert row["region"] == region(sample.robot_angle_deg)
        assert STATES[dataset.labels[index]] == sample.state
    picture = dataset.image(3)
    assert picture is not None
    assert (picture.shape, picture.dtype) == ((120, 160, 3), np.uint8)


@pytest.mark.usefixtures("four_samples_a_piece")
def test_several_processes_write_the_same_files(
    tiny_simulation: Path, undisturbed: Path, tmp_path: Path
) -> None:
    prepare_dataset(Preparation(tiny_simulation, SPEC), tmp_path / "doors", workers=2)
    assert contents(tmp_path / "doors") == contents(undisturbed)


@pytest.mark.usefixtures("four_samples_a_piece")
def test_a_stopped_preparation_continues_with_the_missing_pieces(
    tiny_simulation: Path, undisturbed: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "doors"

    def stop_after_three(done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        prepare_dataset(
            Preparation(tiny_simulation, SPEC),
            folder,
            workers=1,
            progress=stop_after_three,
        )
    assert sorted(path.name for path in folder.iterdir()) == ["pieces", "preparation.json"]
    (folder / "pieces" / "00001.npz").unlink()
    steps: list[tuple[int, int]] = []
    prepare_dataset(
        Preparation(tiny_simulation, SPEC),
        folder,
        workers=1,
        progress=lambda *step: steps.append(step),
    )
    assert steps == [(2, 4), (3, 4), (4, 4)]
    assert contents(folder) == contents(undisturbed)


@pytest.mark.parametrize(
    "lost",
    [
        [DESCRIPTION_FILE],
        [DESCRIPTION_FILE, CLOUDS_FILE],
        [DESCRIPTION_FILE, CLOUDS_FILE, PARTS_FILE, MANIFEST_FILE],
    ],
)
def test_a_preparation_that_stopped_while_assembling_is_completed(
    tiny_simulation: Path, undisturbed: Path, tmp_path: Path, lost: list[str]
) -> None:
    shutil.copytree(undisturbed, tmp_path / "doors")
    for name in lost:
        (tmp_path / "doors" / name).unlink()
    prepare_dataset(Preparation(tiny_simulation, SPEC), tmp_path / "doors", workers=1)
    assert contents(tmp_path / "doors") == contents(undisturbed)


def test_a_complete_data_set_is_opened_and_its_pieces_are_removed(
    tiny_simulation: Path, undisturbed: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "doors"
    shutil.copytree(undisturbed, folder)
    (folder / "pieces").mkdir()
    (folder / "pieces" / "00000.npz").touch()
    steps: list[tuple[int, int]] = []
    summary = prepare_dataset(
        Preparation(tiny_simulation, SPEC),
        folder,
        workers=1,
        progress=lambda *step: steps.append(step),
    )
    assert (len(summary.dataset), steps) == (15, [(1, 1)])
    assert contents(folder) == contents(undisturbed)


def test_clouds_end_at_the_maximum_depth(tiny_simulation: Path, tmp_path: Path) -> None:
    preparation = Preparation(tiny_simulation, CloudSpec(num_points=NUM_POINTS, max_depth_m=3.0))
    near = prepare_dataset(preparation, tmp_path / "near", workers=1).dataset
    far = prepare_dataset(Preparation(tiny_simulation, SPEC), tmp_path / "far", workers=1).dataset
    assert (near.depth_range_m, far.depth_range_m) == (3.0, 5.0)
    assert near.clouds[..., 0].max() <= 3.0 < far.clouds[..., 0].max()
    with pytest.raises(ConfigError, check=about(tmp_path / "near")):
        prepare_dataset(
            preparation._replace(spec=CloudSpec(num_points=NUM_POINTS, max_depth_m=2.0)),
            tmp_path / "near",
            workers=1,
        )


def test_thinned_clouds_equal_those_of_a_predictor(tiny_simulation: Path, tmp_path: Path) -> None:
    preparation = Preparation(tiny_simulation, CloudSpec(num_points=NUM_POINTS, thin=True))
    thinned = prepare_dataset(preparation, tmp_path / "thin", workers=1).dataset
    assert thinned.description.thin
    for index in (0, 7):
        expected = prepare_cloud(thinned.raw_cloud(index), CloudSpec(num_points=NUM_POINTS, thin=True))
        unthinned = prepare_cloud(thinned.raw_cloud(index), SPEC)
        np.testing.assert_array_equal(thinned.cloud(index), expected.points)
        assert not np.array_equal(expected.points, unthinned.points)
    shutil.copy(tmp_path / "thin" / MANIFEST_FILE, tmp_path)
    thinned.description.model_copy(update={"clouds": "replayed"}).save(tmp_path)
    np.testing.assert_array_equal(open_dataset(tmp_path).cloud(7), thinned.cloud(7))
    with pytest.raises(ConfigError, check=about(tmp_path / "thin")):
        prepare_dataset(preparation._replace(spec=SPEC), tmp_path / "thin", workers=1)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("depth_sha256", "0" * 64, "depth_sha256"),
        ("depth_sha256", None, "depth_sha256"),
        ("opening_angle_deg", "44.0", "depth_sha256"),
        ("distance_m", None, "column distance_m"),
        ("distance_m", "far", "column distance_m"),
        ("camera.width", "broad", "column camera.width"),
    ],
)
def test_a_changed_manifest_is_refused(
    tiny_simulation: Path, tmp_path: Path, column: str, value: str | None, message: str
) -> None:
    source = tmp_path / "changed"
    shutil.copytree(tiny_simulation, source)
    rows = read_csv(source / MANIFEST_FILE)
    for row in rows if value is None else rows[4:5]:
        row.pop(column)
        if value is not None:
            row[column] = value
    write_csv(source / MANIFEST_FILE, rows)
    with pytest.raises(DatasetError, match=message) as caught:
        prepare_dataset(Preparation(source, SPEC), tmp_path / "doors", workers=1)
    assert rows[0 if value is None else 4]["sample_id"] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unfinished_simulation_is_not_prepared(tiny_simulation: Path, tmp_path: Path) -> None:
    shutil.copytree(tiny_simulation, tmp_path / "unfinished")
    (tmp_path / "unfinished" / MANIFEST_FILE).unlink()
    with pytest.raises(DatasetError, check=about(tmp_path / "unfinished")):
        prepare_dataset(
            Preparation(tmp_path / "unfinished", SPEC),
            tmp_path / "doors",
            workers=1,
        )


def test_a_folder_with_other_contents_is_refused(
    tiny_simulation: Path, undisturbed: Path, tmp_path: Path
) -> None:
    before = contents(undisturbed)
    with pytest.raises(ConfigError, check=about(undisturbed)):
        prepare_dataset(
            Preparation(tiny_simulation, CloudSpec(num_points=NUM_POINTS // 2)), undisturbed, workers=1
        )
    (tmp_path / "mine.txt").touch()
    for folder in (tmp_path, tmp_path / "mine.txt"):
        with pytest.raises(ConfigError, check=about(folder)):
            prepare_dataset(Preparation(tiny_simulation, SPEC), folder, workers=1)
    assert contents(undisturbed) == before


@pytest.fixture
def class_folders(tmp_path: Path) -> Path:
    """Five valid clouds, and invalid files."""
    root = tmp_path / "OGUROB"
    rng = np.random.default_rng(0)
    for name in ("Open/a.pcd", "Open/b.pcd", "semi-open/a.pcd", "Closed/a.pcd", "Closed/b.pcd"):
        write_pcd(root / name, rng.uniform(1, 4, (12, 50, 3)).astype(np.float32))
    write_pcd(root / "Closed" / "small.pcd", rng.uniform(1, 4, (200, 3)).astype(np.float32))
    write_pcd(root / "Closed" / "tiled.pcd", np.tile(rng.uniform(1, 4, (200, 3)), (2, 1)).astype(np.float32))
    (root / "Open" / "broken.pcd").write_bytes((root / "Open" / "a.pcd").read_bytes()[:900])
    (root / "Open" / "notes.txt").write_text("taken on Monday\n", encoding="utf-8")
    (root / "Open" / "empty.csv").write_text("x,y,z\n", encoding="utf-8")
    (root / "README.txt").write_text("no class folder", encoding="utf-8")
    return root


def test_class_folders_are_prepared_and_rejected_files_listed_with_reasons(
    class_folders: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "doors"
    dataset, rejected = prepare_dataset(Preparation(class_folders, SPEC), folder, workers=1)
    assert {row["sample_id"]: row["state"] for row in dataset.rows} == {
        "Closed/a": "closed",
        "Closed/b": "closed",
        "Open/a": "open",
        "Open/b": "open",
        "semi-open/a": "semi_open",
    }
    for index, row in enumerate(dataset.rows):
        expected = prepare_cloud(read_cloud(class_folders / row["file"]), SPEC).points
        np.testing.assert_array_equal(dataset.cloud(index), expected)
    assert (dataset.description.kind, dataset.description.source) == ("imported", "OGUROB")
    assert dataset.parts(0) is None
    assert dataset.image(0) is None
    reasons = {row["file"]: row["reason"] for row in rejected}
    assert reasons.keys() == {
        "Closed/small.pcd",
        "Closed/tiled.pcd",
        "Open/broken.pcd",
        "Open/empty.csv",
        "Open/notes.txt",
    }
    for name in ("Closed/small.pcd", "Closed/tiled.pcd"):
        assert "200" in reasons[name]
        assert "256" in reasons[name]
    assert all(reason and "\n" not in reason for reason in reasons.values())
    assert read_csv(folder / REJECTED) == rejected
    again = prepare_dataset(Preparation(class_folders, SPEC), folder, workers=1)
    assert again.rejected == rejected


def test_odd_names_are_rejected_or_no_formulas(class_folders: Path, tmp_path: Path) -> None:
    cloud = (class_folders / "Open" / "a.pcd").read_bytes()
    (class_folders / "Open" / "\udcff.pcd").write_bytes(cloud)
    (class_folders / "=open").mkdir()
    (class_folders / "=open" / "a.pcd").write_bytes(b"")
    folder = tmp_path / "doors"
    rejected = prepare_dataset(Preparation(class_folders, SPEC), folder, workers=1).rejected
    assert {"Open/\udcff.pcd", "=open/a.pcd"} < {row["file"] for row in rejected}
    assert {r"Open/\udcff.pcd", "./=open/a.pcd"} < {row["file"] for row in read_csv(folder / REJECTED)}


def test_poses_add_strata_and_read_options_apply(class_folders: Path, tmp_path: Path) -> None:
    poses = tmp_path / "poses.csv"
    poses.write_text("file,x_m,y_m,room\nOpen/a.pcd,0.0,2.2,hall\n", encoding="utf-8")
    options = ReadOptions(axes="optical")
    dataset = prepare_dataset(Preparation(class_folders, SPEC, poses, options), tmp_path / "doors", 1).dataset
    index = dataset.index_of("Open/a")
    row = dataset.rows[index]
    assert (row["distance_band"], row["region"], row["room"]) == ("2.0-2.5", "green", "hall")
    assert dataset.rows[dataset.index_of("Open/b")]["region"] == ""
    # Optical z is forward, x is right, y is down.
    assert dataset.cloud(index)[:, 0].min() >= 1
    assert dataset.cloud(index)[:, 1:].max() <= -1


def test_changed_files_are_another_preparation(class_folders: Path, tmp_path: Path) -> None:
    prepare_dataset(Preparation(class_folders, SPEC), tmp_path / "doors", workers=1)
    (class_folders / "Open" / "b.pcd").unlink()
    with pytest.raises(ConfigError, check=about(tmp_path / "doors")):
        prepare_dataset(Preparation(class_folders, SPEC), tmp_path / "doors", workers=1)


def test_a_source_without_usable_clouds_is_refused_with_the_first_reason(
    class_folders: Path, tmp_path: Path
) -> None:
    with pytest.raises(
        DatasetError, match=r"none of the 10 clouds could be prepared; the first: .*(599|600)"
    ):
        prepare_dataset(Preparation(class_folders, CloudSpec(num_points=4096)), tmp_path / "doors", workers=1)
    assert not (tmp_path / "doors").exists(), "the folder can be used again"
