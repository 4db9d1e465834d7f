# SPDX-License-Identifier: Apache-2.0
"""Resolution studies: their comparisons, and refused files."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.errors import ConfigError
from doorstate.training.resolution import ResolutionStudy
from doorstate.training.study import load_study

STUDY = 'dataset = "d"\nstart_from = "runs/paper"\npoints = [512, 256]\n[fine_tuning]\nepochs = 2\n'


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_all_numbers_of_points_are_tested_and_all_but_the_largest_fine_tuned(tmp_path: Path) -> None:
    study = load_study(write(tmp_path / "mine.toml", STUDY), ResolutionStudy)
    assert study.name == "mine"
    parts = [
        (str(folder), experiment.num_points, experiment.recipe_of("dgcnn").epochs, experiment.start_from)
        for folder, experiment in study.parts()
    ]
    assert parts == [
        ("as-trained-256", 256, 0, "runs/paper"),
        ("fine-tuned-256", 256, 2, "runs/paper"),
        ("as-trained-512", 512, 0, "runs/paper"),
    ]


def test_without_fine_tuning_weights_and_heads_are_tested_unchanged(tmp_path: Path) -> None:
    text = STUDY.partition("[fine")[0] + 'protocol = "by-scene"\nheads = ["angle", "parts"]\n'
    study = load_study(write(tmp_path / "mine.toml", text), ResolutionStudy)
    experiments = [part.experiment for part in study.parts()]
    assert [experiment.num_points for experiment in experiments] == [256, 512]
    assert all(experiment.recipe_of("pointnet").epochs == 0 for experiment in experiments)
    assert experiments[0].heads_of("point2sequence") == ("angle",)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("points = ", "TOML"),
        (STUDY + "epoch = 3\n", "epoch"),
        (STUDY.replace("512", "64"), "points"),
        (STUDY.replace("start_from", "start"), "start"),
    ],
)
def test_wrong_study_is_refused_in_one_line(text: str, field: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=field) as caught:
        list(load_study(write(tmp_path / "mine.toml", text), ResolutionStudy).parts())
    assert "\n" not in str(caught.value)
