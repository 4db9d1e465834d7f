# SPDX-License-Identifier: Apache-2.0
"""End-to-end test of the documentation: every bash and python block of the pages runs, in order, page by page.

What cannot run here (servers, live topics, long trainings) stands in `console` or `text` blocks. Simulations and
trainings get extra options that make them small.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image
from sklearn.metrics import f1_score

from doorstate.evaluation.predictions import load_results
from doorstate.io.pcd import write_pcd
from doorstate.io.readers import read_cloud
from doorstate.simulation.camera import DepthCamera
from doorstate.types import STATES

Run = Callable[..., tuple[int, str, str]]
ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "README.md",
    "docs/tutorial.md",
    "docs/inputs.md",
    "docs/tilt.md",
    "docs/deployment.md",
    "docs/doors.md",
    "docs/live-camera.md",
    "docs/onnx.md",
    "docs/view.md",
)
SMALL = {
    "simulate": "--poses 12 --workers 1",
    "prepare": "--points 128 --workers 1",
    "export": "--clouds 6",
    "compare": "--folds 1 --points 128 --epochs 1 --set batch_size=8 --set precision=fp32",
}
SETUP = ("pip", "make", "git")  # checked, not run


class Block(NamedTuple):
    """A fenced block that runs, and the output that the page shows below it."""

    language: str
    text: str
    output: str


def blocks(page: str) -> list[Block]:
    text = (ROOT / page).read_text(encoding="utf-8")
    fenced = r"^```(bash|python)\n(.*?)^```(?:\n\n```text\n(.*?)^```)?"
    return [Block(*match) for match in re.findall(fenced, text, flags=re.DOTALL | re.MULTILINE)]


def commands(block: Block) -> list[list[str]]:
    lines = block.text.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def comparable(output: str) -> list[list[str]]:
    """Return the words of the lines without milliseconds, and the cells of drawn tables."""
    lines = [line for line in output.splitlines() if line.strip(" ┏┓┳━┡╇┩└┴┘─")]
    plain = [re.sub(r"\s(\d+|\.\.)($| ms)", "", line) for line in lines]
    return [line.split("│")[:-2] if "│" in line else line.rstrip(" ms┃").split() for line in plain]


@pytest.fixture(scope="module")
def sample_files(simulated_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One open door in every form that the pages name, and a recording of twenty frames of it."""
    folder = tmp_path_factory.mktemp("documentation")
    image = read_cloud(sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0])  # (480, 640, 3)
    cloud = image[::2, ::2]
    flat = cloud.reshape(-1, 3)
    write_pcd(folder / "cloud.pcd", cloud)
    for name in ("recording", "recordings"):
        (folder / name).mkdir()
        for number in range(20 if name == "recording" else 1):
            shutil.copy(folder / "cloud.pcd", folder / name / f"{number:02d}.pcd")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(flat)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    (folder / "scan.ply").write_bytes(header.encode() + flat.astype("<f4").tobytes())
    np.save(folder / "cloud.npy", cloud)
    np.save(folder / "optical.npy", np.stack((-cloud[..., 1], -cloud[..., 2], cloud[..., 0]), -1) * 1000)
    np.savetxt(folder / "cloud.csv", flat, delimiter=",", header="x,y,z", comments="")
    Image.fromarray(np.nan_to_num(image[..., 0] * 1000).astype(np.uint16)).save(folder / "depth.png")
    (folder / "camera_info.yaml").write_text(json.dumps(vars(DepthCamera().intrinsics())))
    for name in ("examples", "paper"):
        (folder / name).symlink_to(ROOT / name)
    return folder


@pytest.fixture
def output_of(run: Run, capsys: pytest.CaptureFixture[str]) -> Callable[[Block], str]:
    """Run a block in this process, which spares the start of torch for each command, and return its output."""

    def call(block: Block) -> str:
        if block.language == "python":
            exec(compile(block.text, "page", "exec"), {"__name__": "__main__"})
            return capsys.readouterr().out
        output = ""
        for program, *arguments in commands(block):
            if program == "doorstate":
                code, output, error = run(*arguments, *shlex.split(SMALL.get(arguments[0], "")))
                assert code == 0, f"doorstate {' '.join(arguments)}\n{error}"
            elif program == "python":
                output = subprocess.check_output([sys.executable, *arguments], text=True)
            else:
                assert program in SETUP
        return output

    return call


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_every_block_runs(
    page: str,
    sample_files: Path,
    tmp_path: Path,
    output_of: Callable[[Block], str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(sample_files, folder, symlinks=True)
    monkeypatch.chdir(folder)
    assert blocks(page)
    for block in blocks(page):
        output = output_of(block)
        if block.output:
            assert comparable(output) == comparable(block.output), block.text


def macro_f1_and_errors(experiment: str) -> dict[str, tuple[str, str]]:
    """Return both numbers of every method, from the committed predictions."""
    results = load_results(ROOT / "results" / experiment)
    numbers = {}
    for method in results.methods:
        tested = results.tested_by(method)
        macro_f1 = f1_score(tested["state"], tested["predicted"], labels=list(STATES), average="macro")
        numbers[method] = (f"{macro_f1:.4f}", str(len(tested) - int(tested["correct"].sum())))
    return numbers


def test_the_results_of_the_readme_follow_from_the_predictions() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    row = r"^\| (\S+) \| (0\.\d+) \| (\d+) \| (0\.\d+) \|$"
    table = {
        name.lower().replace("++", "2"): tuple(numbers)
        for name, *numbers in re.findall(row, readme, flags=re.MULTILINE)
    }
    paper, by_pose = macro_f1_and_errors("paper"), macro_f1_and_errors("by-pose")
    assert table == {name: (*numbers, by_pose[name][0]) for name, numbers in paper.items()}
    (errors,) = re.findall(r"`wall_leaf_angle`, has (\d+) errors", readme)
    assert errors == macro_f1_and_errors("related")["wall_leaf_angle"][1]


def test_make_targets_of_the_pages_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, flags=re.MULTILINE))
    used = {
        words[1]
        for page in (*PAGES, "CONTRIBUTING.md")
        for block in blocks(page)
        if block.language == "bash"
        for words in commands(block)
        if words[0] == "make"
    }
    assert {"demo", "test"} <= used <= targets


def test_links_lead_to_files() -> None:
    pages = [
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    ]
    broken = [
        f"{page.relative_to(ROOT)}: {address}"
        for page in pages
        for address in re.findall(r"\]\(([^)\s#]+)[^)]*\)", page.read_text(encoding="utf-8"))
        if "://" not in address and not (page.parent / address).exists()
    ]
    assert broken == []


def test_pages_can_be_read_in_one_sitting() -> None:
    long_pages = {
        str(page.relative_to(ROOT)): lines
        for page in (ROOT / "docs").rglob("*.md")
        if page.name != "commands.md"  # a table to look things up in, a line for each option
        and (lines := page.read_text(encoding="utf-8").count("\n")) > 170
    }
    assert long_pages == {}
