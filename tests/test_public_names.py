# SPDX-License-Identifier: Apache-2.0
"""`import doorstate` offers its public names, and imports each on first use."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import doorstate

ROOT = Path(__file__).resolve().parents[1]


def test_every_public_name_is_there() -> None:
    assert sorted(doorstate.__all__) == doorstate.__all__
    assert all(hasattr(doorstate, name) for name in doorstate.__all__)
    assert doorstate.list_networks() == ["pointnet", "pointnet2", "dgcnn", "pointcnn", "point2sequence"]
    with pytest.raises(AttributeError, match="Predicter"):
        doorstate.Predicter  # noqa: B018


def test_importing_loads_nothing_heavy() -> None:
    script = "import sys, doorstate; print([name for name in ('torch', 'numpy') if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", script], text=True).strip() == "[]"


def test_the_version_is_the_same_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == doorstate.__version__
    assert f"\n## [{doorstate.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\nversion: {doorstate.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
