# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict` of files."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.io.pcd import write_pcd
from tests.cli.helpers import Run, check_error

RECORDED = Path(__file__).resolve().parents[2].parent / "shared" / "real"


def test_table_has_a_row_for_each_file(run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", cloud)
    write_pcd(tmp_path / "b.pcd", cloud)
    code, out, err = run("predict", tmp_path, "--weights", weights)
    assert (code, err) == (0, "")
    assert "a.npy" in out
    assert "b.pcd" in out


def test_file_names_are_printed_literally(run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path) -> None:
    for name in ("rec[red]x.npy", ":door:.npy"):
        np.save(tmp_path / name, cloud)
    (tmp_path / "bad[" / "b]").mkdir(parents=True)
    (tmp_path / "bad[" / "b].npy").write_bytes(b"nothing")
    code, out, err = run("predict", tmp_path, "--weights", weights)
    assert code == 1
    assert "rec[red]x.npy" in out
    assert ":door:.npy" in out
    assert "bad[/b].npy" in err


def test_file_name_with_invalid_characters(
    run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path
) -> None:
    path = tmp_path / os.fsdecode(b"\xff.npy")
    np.save(path, cloud)
    code, out, err = run("predict", path, "--weights", weights, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["file"].endswith(r"\udcff.npy")
    assert run("predict", path, "--weights", weights)[0] == 0


def test_json_has_one_object_a_line(run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", cloud)
    (tmp_path / "b.npy").write_bytes(b"garbage")
    np.save(tmp_path / "c.npy", cloud[:200])
    code, out, _ = run("predict", tmp_path, "--weights", weights, "--json")
    rows = [json.loads(line) for line in out.splitlines()]
    assert code == 1, "one file is damaged"
    assert [Path(row["file"]).name for row in rows] == ["a.npy", "b.npy", "c.npy"]
    good, bad, few = rows
    assert good["state"] in ("closed", "semi_open", "open")
    assert sum(good["probabilities"].values()) == pytest.approx(1, abs=1e-5)
    assert good["state"] == max(good["probabilities"], key=good["probabilities"].__getitem__)
    assert (good["points"], few["points"]) == (256, 200)
    assert good["milliseconds"] > 0
    assert set(bad) == {"file", "error"}
    assert good["method"] == "pointnet"
    assert "b.npy" not in bad["error"], "the file is named in its own field"


def test_rule_predicts_without_weights(run: Run, simulated_folder: Path) -> None:
    path = sorted((simulated_folder / "pcd" / "closed").glob("*.pcd"))[0]
    code, out, err = run("predict", "--rule", "plane_state", "--json", path)
    assert code == 0, err
    row = json.loads(out)
    assert (row["state"] is None) == ("reason" in row)
    code, out, _ = run("predict", "--rule", "open_door", path)
    assert code == 0
    assert " abstained " in out, "this rule detects open doors only"
    check_error(run("predict", "--rule", "open_door", "--points", 128, path), 2, "points")
    assert run("predict", "--rule", "nonsense", path)[0] == 2


@pytest.mark.parametrize("kind", ["empty", "all NaN", "too few", "millimetres"])
def test_unusable_cloud_is_one_line(
    kind: str, run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path
) -> None:
    unusable = {
        "empty": cloud[:0],
        "all NaN": cloud * np.nan,
        "too few": cloud[:20],
        "millimetres": cloud * 1000,
    }
    np.save(tmp_path / "bad.npy", unusable[kind])
    np.save(tmp_path / "good.npy", cloud)
    code, out, err = run("predict", tmp_path / "bad.npy", tmp_path / "good.npy", "--weights", weights)
    assert code == 1
    assert "good.npy" in out
    assert "bad.npy" in err.splitlines()[0]
    assert ("--units mm" in err) == (kind == "millimetres")


def test_units_scale_the_cloud(run: Run, weights: Path, cloud: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "m.npy", cloud)
    np.save(tmp_path / "mm.npy", cloud * 1000)
    _, metres, _ = run("predict", tmp_path / "m.npy", "--weights", weights, "--json")
    code, millimetres, _ = run(
        "predict", tmp_path / "mm.npy", "--weights", weights, "--json", "--units", "mm"
    )
    assert code == 0
    a, b = (json.loads(text)["probabilities"] for text in (metres, millimetres))
    assert a == pytest.approx(b, abs=1e-3)


def test_camera_of_depth_images_from_flags_or_file(run: Run, weights: Path, tmp_path: Path) -> None:
    depth = np.random.default_rng(0).integers(1000, 3000, (30, 40), dtype=np.uint16)
    path = tmp_path / "d.png"
    Image.fromarray(depth).save(path)
    code, _, err = run("predict", path, "--weights", weights)
    assert code == 1
    assert "--intrinsics" in err
    flags = ("--fx", 30, "--fy", 30, "--cx", 19.5, "--cy", 14.5)
    code, from_flags, _ = run("predict", path, "--weights", weights, "--json", *flags)
    assert code == 0
    camera = {"width": 40, "height": 30, "fx": 30, "fy": 30, "cx": 19.5, "cy": 14.5}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    (tmp_path / "camera.yaml").write_text(
        "image_width: 40\nimage_height: 30\ncamera_matrix: {data: [30, 0, 19.5, 0, 30, 14.5, 0, 0, 1]}\n"
    )
    for name in ("camera.json", "camera.yaml"):
        code, out, _ = run("predict", path, "--weights", weights, "--json", "--intrinsics", tmp_path / name)
        assert code == 0
        assert json.loads(out)["probabilities"] == json.loads(from_flags)["probabilities"]
    check_error(run("predict", path, "--weights", weights, "--fx", 30), 2, "fy")


def recorded_frames() -> Iterator[dict[str, str]]:
    with (RECORDED / "index.csv").open(newline="") as stream:
        yield from (row for row in csv.DictReader(stream) if row["fx"] != "?")


@pytest.mark.skipif(not (RECORDED / "index.csv").is_file(), reason="the recorded frames are missing")
def test_recorded_frames_are_predicted(run: Run, weights: Path) -> None:
    predicted = 0
    for frame in recorded_frames():
        flags = [
            item for name in ("fx", "fy", "cx", "cy") if frame[name] for item in (f"--{name}", frame[name])
        ]
        scale = ["--depth-scale", frame["depth_unit_m"]] if frame["depth_unit_m"] else []
        code, out, _ = run(
            "predict", RECORDED / frame["file"], "--weights", weights, "--json", *flags, *scale
        )
        row = json.loads(out)
        if "8bit" in frame["file"]:
            assert code == 1
            assert "error" in row
        else:
            assert code == 0
            assert row["points"] == 256
            predicted += 1
    assert predicted >= 20
