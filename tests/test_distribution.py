# SPDX-License-Identifier: Apache-2.0
"""The sdist and the wheel: built without a warning, holding what they should, working where they are unpacked."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from packaging.metadata import Metadata

from doorstate import __version__
from doorstate.networks import list_networks

pytest.importorskip("build")

NEEDED_FOR_AN_ANSWER = {
    *("numpy", "scipy", "onnxruntime", "pydantic", "typer", "rich", "pillow", "pypcd4", "pyyaml", "filelock")
}
ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "doorstate"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `python -m build` makes of a copy, since setuptools keeps what it once built beside the sources."""
    folder = tmp_path_factory.mktemp("distribution")
    unwanted = shutil.ignore_patterns(
        ".*", "__pycache__", "*.egg-info", "build", "dist", "data", "runs", "reports", "demo"
    )
    shutil.copytree(ROOT, folder / "copy", ignore=unwanted)
    (folder / "copy" / "data").mkdir()
    (folder / "copy" / "data" / "clouds.npy").touch()
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder / "dist", folder / "copy"]
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    finished = subprocess.run(
        command, env=usual | {"PYTHONWARNINGS": "error"}, capture_output=True, text=True, check=False
    )
    output = finished.stdout + finished.stderr
    assert finished.returncode == 0, output
    assert [line for line in output.splitlines() if "warning" in line.lower()] == []
    return folder / "dist"


@pytest.mark.slow
def test_both_hold_the_package_and_nothing_else(built: Path) -> None:
    (sdist,), (wheel,) = built.glob("*.tar.gz"), built.glob("*.whl")
    sources = {
        path.relative_to(PACKAGE.parent).as_posix()
        for path in PACKAGE.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {"doorstate/py.typed", "doorstate/evaluation/templates/report.html.j2"} <= sources
    assert any(name.startswith("doorstate/networks/pretrained/") for name in sources)
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
        about = {name.partition(".dist-info/")[2] for name in archive.namelist()} - {""}
    assert held == sources
    assert about == {"METADATA", "WHEEL", "RECORD", "entry_points.txt", "top_level.txt", "licenses/LICENSE"}
    with tarfile.open(sdist) as archive:
        root = f"doorstate-{__version__}/"
        held = {member.name.removeprefix(root) for member in archive.getmembers() if member.isfile()}
    beside = {name for name in held if not name.startswith("src/")}
    assert {name.removeprefix("src/") for name in held - beside if ".egg-info" not in name} == sources
    own = {"LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "pyproject.toml", "MANIFEST.in"}
    assert beside == own | {"PKG-INFO", "setup.cfg"}


@pytest.mark.slow
def test_the_metadata_are_valid_and_complete(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith("/METADATA"))
        metadata = Metadata.from_email(archive.read(name), validate=True)
    assert (metadata.name, str(metadata.version)) == ("doorstate", __version__)
    assert (metadata.license_expression, metadata.license_files) == ("Apache-2.0", ["LICENSE"])
    assert str(metadata.requires_python) == ">=3.11"
    assert "Typing :: Typed" in (metadata.classifiers or [])
    assert {"train", "bags", "serve", "onnx", "fast", "docs"} <= set(metadata.provides_extra or [])
    requirements = metadata.requires_dist or []
    assert {entry.name for entry in requirements if entry.marker is None} == NEEDED_FOR_AN_ANSWER
    assert metadata.description_content_type == "text/markdown"


@pytest.mark.slow
def test_the_unpacked_wheel_answers(built: Path, simulated_folder: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("*.whl")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--target", tmp_path]
    subprocess.run([*pip, "--disable-pip-version-check", wheel], check=True)
    (cloud, *_) = sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))
    script = (
        "import sys, doorstate.cli as cli; print(cli.__file__); cli.main()",
        "predict",
        cloud,
        "--rule",
        "plane_state",
    )
    output = subprocess.check_output(
        [sys.executable, "-c", *script],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        text=True,
    )
    assert output.startswith(str(tmp_path))
    assert "  open  " in output


@pytest.mark.slow
def test_the_wheel_stays_small(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    assert wheel.stat().st_size <= 30e6


def test_packaged_weights_stay_small() -> None:
    weights = {
        path.stem: path.stat().st_size for path in (PACKAGE / "networks/pretrained").glob("*.safetensors")
    }
    assert set(weights) == {"pointnet2", *(f"ogurob-{name}" for name in list_networks())}
    assert sum(weights.values()) <= 25e6
    graphs = {path.stem: path.stat().st_size for path in (PACKAGE / "networks/pretrained").glob("*.onnx")}
    assert set(graphs) == set(weights)
    assert max(graphs.values()) <= 100e3, "they hold no weights"


def test_a_clone_stays_small() -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("no clone of the repository")
    files = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")
    sizes = {name: (ROOT / name).stat().st_size for name in files if name and (ROOT / name).is_file()}
    assert sum(sizes.values()) <= 45e6
    assert sum(size for name, size in sizes.items() if name.startswith("results/")) <= 12e6
    reports = [
        name for name in sizes if name.startswith("results/") and name.endswith((".html", ".png", ".svg"))
    ]
    assert reports == []
