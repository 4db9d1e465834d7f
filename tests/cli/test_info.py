# SPDX-License-Identifier: Apache-2.0
"""`doorstate info`."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import doorstate
from doorstate.cli import installation
from doorstate.networks import MULTI_VIEW, list_networks
from doorstate.networks.packaged import packaged_networks
from doorstate.rules import list_rules
from tests.cli.helpers import Run


def test_json_lists_versions_weights_networks_and_rules(run: Run) -> None:
    code, out, _ = run("info", "--json")
    info = json.loads(out)
    assert code == 0
    assert info["doorstate"] == doorstate.__version__
    assert info["rules"] == list_rules()
    assert [entry["network"] for entry in info["networks"]] == [*list_networks(), *MULTI_VIEW]
    packaged = {entry["network"]: entry["packaged_weights"] for entry in info["networks"]}
    assert sum(map(len, packaged.values())) == len(packaged_networks())
    weights = {entry["weights"]: entry for entry in info["weights"]}
    assert list(weights) == packaged_networks()
    assert [name for name, entry in weights.items() if entry["default"]] == ["pointnet2"]
    assert weights["pointnet2"]["clean"]["frames"] == 20


def test_text_fits_a_terminal(run: Run) -> None:
    code, out, _ = run("info")
    assert code == 0
    assert all(name in out for name in (*list_networks(), *MULTI_VIEW, *list_rules(), *packaged_networks()))
    tables = out[out.index("Packaged weights") : out.index("networks:")]
    assert max(map(len, tables.splitlines())) <= 80


def test_missing_packages_are_named_by_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    requirements = [
        "numpy>=2",
        "nowhere>=1; extra == 'train'",
        'pytest>=8; extra == "train"',
        "x; extra == 'dev'",
    ]
    monkeypatch.setattr(installation.metadata, "requires", lambda name: requirements)
    assert installation.missing_by_extra() == {"train": ["nowhere"]}


def test_large_packages_are_not_imported() -> None:
    script = "import sys; sys.argv[1:] = ['info', '--json']\n"
    script += "from doorstate.cli import main\ntry: main()\nexcept SystemExit: pass\n"
    script += "print([name for name in ('torch', 'pandas', 'sklearn', 'matplotlib') if name in sys.modules])"
    out = subprocess.check_output([sys.executable, "-c", script], text=True)
    assert out.splitlines()[-1] == "[]"
