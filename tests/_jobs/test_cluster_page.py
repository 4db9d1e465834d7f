# SPDX-License-Identifier: Apache-2.0
"""Recipes of docs/cluster.md: Ray accepts the file of the cloud, and the commands exist."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
import yaml

from tests.conftest import Run

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "cluster.md").read_text(encoding="utf-8")


def test_ray_accepts_the_file_of_the_cloud() -> None:
    ray = pytest.importorskip("ray", reason="Ray is not installed: the extra cluster brings it")
    jsonschema = pytest.importorskip("jsonschema")  # Ray needs it
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    config = yaml.safe_load(text)
    schema = Path(ray.__file__).parent / "autoscaler" / "ray-schema.json"
    jsonschema.validate(config, json.loads(schema.read_text(encoding="utf-8")))
    assert config["available_node_types"]["head"]["resources"] == {"CPU": 0}, "no piece runs on the head"


def test_options_of_the_commands_exist(run: Run) -> None:
    lines = re.findall(r"doorstate (compare|simulate|prepare)( [^'\n]*)", PAGE.replace("\\\n", ""))
    assert len(lines) >= 5
    for command, options in lines:
        _, text, _ = run(command, "--help")
        used = {word for word in shlex.split(options) if word.startswith("--")}
        assert used <= set(re.findall(r"--[a-z-]+", text))
