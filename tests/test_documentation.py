# SPDX-License-Identifier: Apache-2.0
"""End-to-end test of the documentation: every bash and python block of the pages runs, in order, page by page.

What cannot run here (servers, live topics, long trainings) stands in `console` or `text` blocks. Simulations and
trainings get extra options that make them small.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.io.pcd import write_pcd
from doorstate.io.readers import read_cloud
from doorstate.simulation.camera import DepthCamera

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "README.md",
    "docs/tutorial.md",
    "docs/inputs.md",
    "docs/bags.md",
    "docs/deployment.md",
    "docs/onnx.md",
    "docs/view.md",
)
SMALL = {
    "simulate": "--poses 12 --workers 1",
    "prepare": "--points 128 --workers 1",
    "compare": "--folds 1 --points 128 --epochs 1 --set batch_size=8 --set precision=fp32",
}
PROGRAMS = {"python": sys.executable, "doorstate": str(Path(sys.executable).with_name("doorstate"))}
SETUP = ("pip", "make", "git")  # checked, not run


def blocks(page: str) -> Iterator[tuple[str, str]]:
    """Language and text of the fenced blocks that are meant to run."""
    text = (ROOT / page).read_text(encoding="utf-8")
    yield from re.findall(r"^```(bash|python)\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def commands(block: str) -> list[list[str]]:
    lines = block.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


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


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_every_block_runs(page: str, sample_files: Path, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    shutil.copytree(sample_files, folder, symlinks=True)
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    count = 0
    for language, block in blocks(page):
        if language == "python":
            runs = [[sys.executable, "-c", block]]
        else:
            words_of_commands = [words for words in commands(block) if words[0] not in SETUP]
            runs = [
                [PROGRAMS[program], *arguments, *shlex.split(SMALL.get(arguments[0], ""))]
                for program, *arguments in words_of_commands
            ]
        for run in runs:
            finished = subprocess.run(
                run, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=300
            )
            assert finished.returncode == 0, f"{page}: {' '.join(run)}\n{finished.stderr}"
            count += 1
    assert count


def test_make_targets_of_the_pages_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, flags=re.MULTILINE))
    used = {
        words[1]
        for page in (*PAGES, "CONTRIBUTING.md")
        for language, block in blocks(page)
        if language == "bash"
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
        if (lines := page.read_text(encoding="utf-8").count("\n")) > 170
    }
    assert long_pages == {}
