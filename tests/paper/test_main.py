# SPDX-License-Identifier: Apache-2.0
"""Commands of `python -m paper`: arguments, output and exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest
from paper.__main__ import app
from typer.testing import CliRunner

from paper import check, publish, report, run, weights


@pytest.mark.parametrize(("problems", "exit_code"), [([], 0), (["docs/results.md: differs"], 1)])
def test_check_fails_if_something_differs(
    problems: list[str], exit_code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(check, "check", lambda: problems)
    result = CliRunner().invoke(app, ["check"])
    assert result.exit_code == exit_code
    assert all(problem in result.output for problem in problems)


@pytest.mark.parametrize(("now", "exit_code"), [(0.99, 0), (0.97, 1)])
def test_repeat_fails_outside_of_the_published_spread(
    now: float, exit_code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "repeat_run", lambda network, fold, name: (now, 0.99, 0.01))
    assert CliRunner().invoke(app, ["repeat", "pointnet2", "0"]).exit_code == exit_code


def test_every_named_experiment_is_published(monkeypatch: pytest.MonkeyPatch) -> None:
    names: list[str] = []
    monkeypatch.setattr(publish, "publish", lambda name: names.append(name) or Path(name))
    assert CliRunner().invoke(app, ["publish", "paper", "by-pose"]).exit_code == 0
    assert names == ["paper", "by-pose"]


def test_report_is_written_into_a_given_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[str, Path | None]] = []
    monkeypatch.setattr(
        report, "write_published_report", lambda name, out: calls.append((name, out)) or tmp_path
    )
    assert CliRunner().invoke(app, ["report", "paper", "--out", str(tmp_path)]).exit_code == 0
    assert calls == [("paper", tmp_path)]


def test_networks_are_separated_by_commas(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[object] = []
    monkeypatch.setattr(weights, "package_weights", lambda *arguments: calls.append(arguments) or [])
    command = ["weights", "mixture-wide", "--networks", "pointnet2, dgcnn", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert calls == [("mixture-wide", "", ["pointnet2", "dgcnn"], tmp_path)]
