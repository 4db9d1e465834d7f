# SPDX-License-Identifier: Apache-2.0
"""A study is a list of comparisons that go on from finished weights."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.errors import ConfigError
from doorstate.training.resolution import load_study

STUDY = 'dataset = "d"\nstart_from = "runs/paper"\npoints = [512, 256]\n[fine_tuning]\nepochs = 2\n'


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_every_number_of_points_is_tested_and_all_but_the_largest_trained_on(tmp_path: Path) -> None:
    study = load_study(write(tmp_path / "mine.toml", STUDY))
    found = [
        (name, each.num_points, each.recipe_of("dgcnn").epochs, each.start_from)
        for name, each in study.experiments()
    ]
    assert found == [
        ("as-trained-256", 256, 0, "runs/paper"),
        ("fine-tuned-256", 256, 2, "runs/paper"),
        ("as-trained-512", 512, 0, "runs/paper"),
    ]


def test_without_fine_tuning_nothing_is_trained_and_heads_stay(tmp_path: Path) -> None:
    text = STUDY.partition("[fine")[0] + 'protocol = "by-scene"\nheads = ["angle", "parts"]\n'
    experiments = [each for _, each in load_study(write(tmp_path / "mine.toml", text)).experiments()]
    assert [each.num_points for each in experiments] == [256, 512]
    assert all(each.recipe_of("pointnet").epochs == 0 for each in experiments)
    assert experiments[0].heads_of("point2sequence") == ("angle",)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("points = ", "cannot be read as a study"),
        (STUDY + "epoch = 3\n", "recipe_changes: epoch: Extra inputs"),
        (STUDY.replace("512", "64"), "points"),
        (STUDY.replace("start_from", "start"), "start"),
    ],
)
def test_a_wrong_study_is_one_line(text: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=complaint) as caught:
        load_study(write(tmp_path / "mine.toml", text))
    assert "\n" not in str(caught.value)
