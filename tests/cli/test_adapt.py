# SPDX-License-Identifier: Apache-2.0
"""`doorstate adapt`: weights, card and JSON; what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch

from doorstate._files import read_csv, write_csv
from doorstate.cli.adapt import _default_cache
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import read_card, save_weights
from doorstate.training.adaptation import simulated
from doorstate.training.adaptation import weights as adapted_weights
from doorstate.training.adaptation.simulated import SimulatedPart
from tests.cli.helpers import Run, check_error


def test_weights_for_whole_clouds_are_adapted(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        simulated,
        "WHOLE",
        ((SimulatedPart("ogurob", "none", 4, 1),), (SimulatedPart("ogurob", "none", 4, 2),)),
    )
    monkeypatch.setattr(adapted_weights, "MOST_FORGOTTEN", 1.0)
    assert (
        run("simulate", "--out", tmp_path / "site", "--poses", 4, "--keep", "depth", "--workers", 1)[0] == 0
    )
    folder, start, out = (
        tmp_path / "site" / "depth",
        tmp_path / "start.safetensors",
        tmp_path / "site.safetensors",
    )
    torch.manual_seed(0)
    save_weights(start, create_network("pointnet2"), WeightsCard(network="pointnet2", num_points=128))
    command = (
        *("adapt", folder, "--out", out, "--weights", start, "--cache", tmp_path / "cache", "--workers", 1),
        *("--epochs", 1, "--set", "batch_size=8", "--set", "clouds_per_epoch=8", "--set", "precision=fp32"),
    )
    code, printed, err = run(*command, "--json")
    assert code == 0, err
    result = json.loads(printed)
    assert (result["frames"], result["held_out"], result["left_out"]) == (12, 3, {})
    assert {row["method"] for row in result["scores"]} >= {"before", "after"}
    assert read_card(out).trained_on.endswith("adapted to 9 labelled frames")
    assert "Held-out frames" in out.with_suffix(".md").read_text(encoding="utf-8")
    first = out.read_bytes()
    code, printed, _ = run(*command)
    assert code == 0
    assert "before" in printed
    assert out.read_bytes() == first

    rows = read_csv(folder / "index.csv")
    write_csv(folder / "index.csv", [row for row in rows if row["state"] != "open"])
    check_error(run(*command), 1, "no open door among 8 labelled frames")


def test_impossible_options_are_refused(run: Run, tmp_path: Path) -> None:
    check_error(run("adapt", tmp_path, "--out", tmp_path / "site.onnx"), 2, "--out")
    both = ("--network", "pointnet2", "--weights", tmp_path / "a.safetensors")
    check_error(run("adapt", tmp_path, "--out", tmp_path / "site.safetensors", *both), 2, "--weights")
    check_error(run("adapt", tmp_path, "--out", tmp_path / "site.safetensors"), 1, str(tmp_path))


def test_the_cache_is_that_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert _default_cache() == Path("/somewhere/doorstate")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert _default_cache() == Path.home() / ".cache" / "doorstate"
