# SPDX-License-Identifier: Apache-2.0
"""Reading options: a command gets them as one value beside its own options."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from doorstate.cli.evaluate import evaluate
from doorstate.cli.predict import predict
from doorstate.cli.prepare import prepare
from doorstate.cli.reading_options import check_layout, read_options, with_reading_options
from doorstate.cli.view import view
from doorstate.errors import ConfigError
from doorstate.io.camera import Pinhole
from doorstate.io.options import ReadOptions


def test_command_gets_one_value() -> None:
    calls = []

    @with_reading_options
    def command(name: str, every: int = 1, *, options: ReadOptions) -> None:
        calls.append((name, every, options))

    app = typer.Typer()
    app.command()(command)
    arguments = ["a", "--every", "3", "--axes", "optical", "--units", "mm"]
    arguments += ["--fx", "500", "--fy", "501", "--cx", "320", "--cy", "240"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    camera = Pinhole(500.0, 501.0, 320.0, 240.0)
    assert calls == [("a", 3, ReadOptions(axes="optical", intrinsics=camera, units_m=0.001))]


def test_a_quaternion_and_a_pitch_are_the_same_pose() -> None:
    # The rotation that tf2_echo prints for an optical frame that looks 30 degrees down.
    turned = read_options(axes="optical", quaternion="-0.612 0.612 -0.354 0.354")
    tilted = read_options(axes="optical", pitch=30.0)
    np.testing.assert_allclose(turned.pose().rotation, tilted.pose().rotation, atol=2e-3)


@pytest.mark.parametrize(
    "arguments",
    [{"quaternion": "1 2 3"}, {"quaternion": "0 0 0 1", "roll": 90.0}, {"axes": "lfu"}, {"pitch": 91.0}],
)
def test_impossible_poses_are_errors_of_usage(arguments: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        read_options(**arguments)


@pytest.mark.parametrize("command", [evaluate, predict, prepare, view])
def test_commands_share_the_options(command: object) -> None:
    names = list(inspect.signature(command).parameters)  # type: ignore[arg-type]
    shared = list(inspect.signature(read_options).parameters)
    assert [name for name in names if name in shared] == shared
    assert "options" not in names


def test_a_layout_excludes_all_but_the_camera() -> None:
    camera = Pinhole(500.0, 501.0, 320.0, 240.0)
    check_layout("deepdoors2", ReadOptions(intrinsics=camera))
    check_layout(None, ReadOptions(roll_deg=90))
    for options in (ReadOptions(axes="optical"), ReadOptions(roll_deg=90), ReadOptions(units_m=0.001)):
        with pytest.raises(ConfigError):
            check_layout("deepdoors2", options)
