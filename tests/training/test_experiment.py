# SPDX-License-Identifier: Apache-2.0
"""Experiment files: precedence of options, files and defaults; refused values."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from doorstate.errors import ConfigError
from doorstate.training.experiment import Experiment, load_experiment
from doorstate.training.resolution import ResolutionStudy
from doorstate.training.study import Study, load_study
from doorstate.training.transfer import TransferStudy

EXPERIMENTS = Path(__file__).parents[2] / "paper" / "experiments"


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_overrides_win_over_the_file_and_the_file_over_defaults(tmp_path: Path) -> None:
    path = write(
        tmp_path / "mine.toml",
        'dataset = "d"\nnum_points = 512\nseed = 4\n[recipe_changes]\nepochs = 5\nbatch_size = 4\n',
    )
    experiment = load_experiment(path, {"num_points": 256, "recipe_changes": {"epochs": 7}})
    assert (experiment.name, experiment.num_points, experiment.seed, experiment.folds) == ("mine", 256, 4, 5)
    assert experiment.recipe_changes == {"epochs": 7, "batch_size": 4}
    assert experiment.recipe_of("pointnet").epochs == 7


def test_overrides_win_over_changes_of_single_networks(tmp_path: Path) -> None:
    path = write(
        tmp_path / "mine.toml",
        'dataset = "d"\n[recipe_changes]\nepochs = 5\n[network_changes.dgcnn]\nepochs = 3\nbatch_size = 4\n',
    )
    experiment = load_experiment(path, {})
    assert [experiment.recipe_of(network).epochs for network in ("pointnet", "dgcnn")] == [5, 3]
    experiment = load_experiment(path, {"recipe_changes": {"epochs": 7}})
    assert [experiment.recipe_of(network).epochs for network in ("pointnet", "dgcnn")] == [7, 7]
    assert experiment.recipe_of("dgcnn").batch_size == 4


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("dataset = ", "TOML"),
        ("x = 1", "x|dataset"),
        ('dataset = "d"\nnetworks = ["pointnett"]', "'pointnet'"),
        ('dataset = "d"\nprotocol = "random"', "protocol"),
        ('dataset = "d"\nrecipe = "best"', "recipe"),
        ('dataset = "d"\n[recipe_changes]\nepoch = 3', "recipe_changes.* epoch"),
        ('dataset = "d"\nrecipe_changes = 3', "recipe_changes"),
        ('dataset = "d"\n[network_changes.pointnett]\nepochs = 3', "'pointnett'"),
        ('dataset = "d"\n[network_changes.dgcnn]\nepoch = 3', "recipe_changes.* epoch"),
        ('dataset = "d"\n[network_options.pointnett]\nk = 3', "'pointnett'"),
        ('dataset = "d"\n[network_options.dgcnn]\ncentres = [1, 2]', "'centres'"),
        ('dataset = "d"\n[network_options.pointnet2]\ncentres = [256]', "centres"),
        ('dataset = "d"\nprotocol = "all"', "folds"),
        ('dataset = "d"\nprotocol = "unseen"', "folds"),
        ('dataset = "d"\nprotocol = "unseen"\nfolds = 1', "recipe_changes.epochs"),
        ('dataset = "d"\nheads = ["door"]\nrecipe_changes = {loss_weights = {angle = 2}}', "'angle'"),
        ('dataset = "d"\nfolds = 6', "folds"),
    ],
)
def test_wrong_experiment_is_refused_in_one_line(text: str, name: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=name) as caught:
        load_experiment(write(tmp_path / "mine.toml", text), {})
    assert "\n" not in str(caught.value)


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_experiment(tmp_path / "gone.toml", {})
    assert caught.value.path == tmp_path / "gone.toml"


@pytest.mark.parametrize("path", sorted(EXPERIMENTS.glob("*.toml")), ids=lambda path: path.name)
def test_experiments_of_the_paper_are_valid(path: Path) -> None:
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    loaded: Experiment | Study
    if "points" in content:
        loaded = load_study(path, ResolutionStudy)
    elif "tested" in content:
        loaded = load_study(path, TransferStudy)
    else:
        loaded = load_experiment(path, {})
    assert loaded.name == path.stem
