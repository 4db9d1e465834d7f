# SPDX-License-Identifier: Apache-2.0
"""`doorstate info`."""

from __future__ import annotations

import json

import doorstate
from doorstate.networks import list_networks
from doorstate.networks.packaged import packaged_networks
from doorstate.rules import list_rules
from tests.cli.helpers import Run


def test_json_lists_versions_networks_and_rules(run: Run) -> None:
    code, out, _ = run("info", "--json")
    info = json.loads(out)
    assert code == 0
    assert info["doorstate"] == doorstate.__version__
    assert info["rules"] == list_rules()
    assert [entry["network"] for entry in info["networks"]] == list_networks()
    assert {entry["parameters"] for entry in info["networks"]} >= {3_470_540, 1_466_179}
    packaged = {entry["network"]: entry["packaged_weights"] for entry in info["networks"]}
    assert "pointnet2" in packaged["pointnet2"]
    assert sum(map(len, packaged.values())) == len(packaged_networks())


def test_tables_list_networks_and_rules(run: Run) -> None:
    code, out, _ = run("info")
    assert code == 0
    assert all(name in out for name in (*list_networks(), *list_rules()))
