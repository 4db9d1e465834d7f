# SPDX-License-Identifier: Apache-2.0
"""`doorstate evaluate`, and its page in the browser."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from doorstate._files import write_csv
from doorstate.cli import main, progress
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import ABSTAINED
from tests.cli.helpers import Run, check_error
from tests.headless_chromium import open_browser_page, wait_until


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Index of simulated depth images: two doors in three states, one frame without a door, one 8-bit image."""
    folder = tmp_path_factory.mktemp("recordings") / "lab"
    folder.mkdir()
    camera = {"fx": "554.3", "fy": "554.3", "cx": "319.5", "cy": "239.5", "depth_unit_m": "0.001"}
    rows = []
    for pose, door in ((700, "oak"), (300, "glass front")):
        for sample in draw_rows(PRESETS["ogurob"], 3, pose):
            frame = replay(sample)
            name = f"{pose}_{sample.state}.png"
            depth_mm = np.nan_to_num(frame.cut.depth_m * 1000).astype(np.uint16)
            Image.fromarray(depth_mm).save(folder / name)
            rows.append({"file": name, "state": sample.state, "door": door, **camera})
    Image.new("RGB", (64, 48), (200, 10, 10)).save(folder / "photo_rgb.png")
    rows[0]["rgb"] = "photo_rgb.png"
    Image.fromarray(np.full((480, 640), 2500, np.uint16)).save(folder / "wall.png")
    rows.append({"file": "wall.png", "state": "none", "door": "", **camera})
    Image.new("L", (640, 480)).save(folder / "coarse.png")
    rows.append({"file": "coarse.png", "state": "open", "door": "oak", **camera})
    write_csv(folder / "index.csv", rows)
    return folder


class Report(NamedTuple):
    """Folder that a command has written, and what it printed."""

    folder: Path
    code: int
    out: str
    err: str


@pytest.fixture(scope="module")
def report(recordings: Path, weights: Path, tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder = tmp_path_factory.mktemp("report")
    arguments = ["evaluate", recordings, "--weights", weights, "--rule", "plane_state", "--by", "door:glass"]
    out, err = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", ["doorstate", *map(str, arguments), "--all", "--out", str(folder)])
        patch.setattr(progress, "FIRST_LINE_S", 3600.0)
        with pytest.raises(SystemExit) as ended:
            main()
    return Report(folder, int(ended.value.code or 0), out.getvalue(), err.getvalue())


def test_predictions_are_scored_and_written(report: Report) -> None:
    folder, code, out, err = report
    assert code == 1  # one file could not be read
    assert err.startswith("coarse.png: ")
    assert err.count("coarse.png") == 1
    assert "plane_state" in out
    metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    correct = {row["method"]: row["correct"] for row in metrics["scores"]}
    assert list(correct)[:2] == ["pointnet", "plane_state"]
    assert list(metrics["unreadable"]) == ["coarse.png"]
    # Doors without noise at 2 to 3 m are easy for the rule.
    assert correct["plane_state"] >= 5
    with (folder / "predictions.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 7
    assert (
        sum(row["predicted"] == row["state"] for row in rows if row["method"] == "plane_state")
        == correct["plane_state"]
    )
    assert (folder / "tables" / "recall.csv").is_file()


def test_page_draws_clouds_and_filters_frames(report: Report) -> None:
    with open_browser_page() as (page, errors):
        page.goto((report.folder / "frames.html").as_uri())
        assert page.locator(".card").count() == 7
        assert page.locator(".card .cloud").count() == 14
        sources = page.evaluate("[...document.images].map((image) => image.src.slice(0, 15))")
        assert sources == ["data:image/jpeg"] * 8  # the photo and seven depth images
        page.locator(".card .cloud").first.scroll_into_view_if_needed()
        wait_until(
            page,
            "document.querySelector('.card canvas').getContext('2d').getImageData(0, 0, 150, 100).data.some((v) => v)",
        )
        chips = page.locator(".chips button")
        assert chips.evaluate_all("(all) => all.map((chip) => chip.dataset.choice)") == [
            "",
            "pointnet",
            "plane_state",
        ]
        chips.nth(2).click()
        visible = page.locator(".card:not([hidden])").evaluate_all(
            "(all) => all.map((card) => card.dataset.file)"
        )
        with (report.folder / "predictions.csv").open(encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["method"] == "plane_state"]
        correct = {"no_door": ABSTAINED}
        wrong = {row["file"] for row in rows if row["predicted"] != correct.get(row["state"], row["state"])}
        assert set(visible) == wrong
        chips.nth(0).click()
        page.locator(".card .cloud").first.click()
        page.wait_for_selector("div.cloud.large canvas.turnable")
        assert errors == []


def test_page_shows_the_frames_that_changed(recordings: Path, run: Run, tmp_path: Path) -> None:
    rules = ("--rule", "open_door", "--rule", "plane_state")
    code, _, _ = run("evaluate", recordings, *rules, "--changed", "--out", tmp_path)
    assert code == 1  # one file could not be read
    (change,) = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))["changes"]
    assert (change["before"], change["after"], change["frames"]) == ("open_door", "plane_state", 6)
    assert change["corrected"] > 0
    page = (tmp_path / "frames.html").read_text(encoding="utf-8")
    assert f"<h3>{change['corrected']} corrected</h3>" in page
    assert (tmp_path / "tables" / "changes.csv").is_file()


def test_state_folders_give_the_same_files_twice(recordings: Path, run: Run, tmp_path: Path) -> None:
    for state in ("closed", "semi_open", "open"):
        (tmp_path / state).mkdir()
        (tmp_path / state / "a.png").write_bytes((recordings / f"700_{state}.png").read_bytes())
    command = ("evaluate", tmp_path, "--rule", "plane_state", "--all")
    camera = ("--fx", 554.3, "--fy", 554.3, "--cx", 319.5, "--cy", 239.5)
    first, second = tmp_path.with_name("first"), tmp_path.with_name("second")
    code, out, err = run(*command, *camera, "--out", first)
    assert code == 0
    assert "frames.html" in err
    code, out, _ = run(*command, *camera, "--json", "--out", second)
    assert code == 0
    written = json.loads((first / "metrics.json").read_text(encoding="utf-8"))
    assert json.loads(out).items() <= written.items()
    for name in ("frames.html", "predictions.csv", "metrics.json", "tables/scores.csv"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "expected_code", "name"),
    [
        (("--by", "colour"), 2, "colour"),
        (("--group", "building"), 2, "building"),
        (("--rule", "plane_state", "--rule", "plane_state"), 2, "plane_state"),
        (("--rule", "guess"), 2, "guess"),
        (("--network", "nobody"), 2, "nobody"),
        (("--layout", "kitti"), 2, "kitti"),
        (("--layout", "deepdoors2", "--roll", "90"), 2, "--layout"),
        (("--all",), 2, "--all"),
        (("--changed",), 2, "--changed"),
        (("--changed", "--all", "--out", "report"), 2, "--changed"),
        (("--changed", "--rule", "plane_state", "--out", "report"), 2, "--changed"),
        (("--rule", "plane_state", "--points", "512"), 2, "points"),
        (("--out", "index.csv/report"), 1, "index.csv/report/frames.html"),
    ],
)
def test_errors_are_one_line(
    arguments: tuple[str, ...], expected_code: int, name: str, recordings: Path, run: Run
) -> None:
    arguments = tuple(str(recordings / word) if word.startswith("index.csv") else word for word in arguments)
    check_error(run("evaluate", recordings, *arguments), expected_code, name)


def test_folder_without_readable_files_is_an_error(run: Run, tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open" / "a.pcd").write_bytes(b"no cloud")
    code, out, err = run("evaluate", tmp_path, "--rule", "plane_state")
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].startswith("doorstate: ")
    assert str(tmp_path) in err


def test_processes_give_the_same_scores(run: Run, recordings: Path) -> None:
    (_, alone, _), (code, together, _) = (
        run("evaluate", recordings, "--rule", "plane_state", "--json", *options)
        for options in ((), ("--workers", "2"))
    )
    assert code == 1, "one image cannot be read"
    assert together == alone


def test_a_cluster_needs_a_folder(run: Run, recordings: Path) -> None:
    check_error(run("evaluate", recordings, "--engine", "ray", "--address", "auto"), 2, "--out")
