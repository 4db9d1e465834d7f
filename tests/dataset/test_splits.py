# SPDX-License-Identifier: Apache-2.0
"""Splits: shares, strata, and no trained pose near a tested one."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from doorstate.dataset.splits import draw_splits, read_splits, write_splits
from doorstate.dataset.strata import distance_band, polar, region
from doorstate.errors import ConfigError, DatasetError
from doorstate.simulation.draw.half_ring import half_ring, reduced_ring
from doorstate.types import STATES


def rows_at(indices: list[int]) -> list[dict[str, str]]:
    rows = []
    for index in indices:
        position = half_ring()[index]
        distance_m, angle_deg = polar(position.x_m, position.y_m)
        rows += [
            {
                "sample_id": f"p{index}-{state}",
                "pose_id": f"p{index}",
                "state": state,
                "distance_m": str(distance_m),
                "robot_angle_deg": str(angle_deg),
                "distance_band": distance_band(distance_m),
                "region": region(angle_deg),
            }
            for state in STATES
        ]
    return rows


ALL = rows_at(list(range(1353)))


@pytest.mark.parametrize("protocol", ["paper", "by-pose"])
def test_every_sample_has_a_role_and_is_tested_once(protocol: str) -> None:
    splits = draw_splits(ALL, protocol, 0)
    assert len(splits) == 5
    assert all(list(roles) == [row["sample_id"] for row in ALL] for roles in splits)
    tested = Counter(sample for roles in splits for sample, role in roles.items() if role == "test")
    assert set(tested.values()) == {1}
    assert len(tested) == len(ALL)


def test_the_folds_of_the_paper_are_70_10_20_in_total_and_in_every_stratum() -> None:
    for roles in draw_splits(ALL, "paper", 0):
        counts = Counter(roles.values())
        # 4059 samples make tenths of 405 or 406.
        assert counts["test"] in (811, 812)
        assert counts["val"] in (405, 406)
        assert counts["train"] == 4059 - counts["test"] - counts["val"]
        strata = Counter((row["state"], row["distance_band"], row["region"]) for row in ALL)
        tested = Counter(
            (row["state"], row["distance_band"], row["region"])
            for row in ALL
            if roles[row["sample_id"]] == "test"
        )
        assert len(strata) == 60
        # Two tenths, each within one sample of its share.
        assert all(abs(tested[name] - size / 5) < 2 for name, size in strata.items())


@given(seed=st.integers(0, 2**32 - 1), sizes=st.lists(st.integers(1, 30), min_size=4, max_size=12))
@settings(max_examples=40)
def test_any_strata_are_spread_evenly(seed: int, sizes: list[int]) -> None:
    rows = [
        {"sample_id": f"{number}-{k}", "state": STATES[number % 3], "region": str(number)}
        for number, size in enumerate([*sizes, 30])
        for k in range(size)
    ]
    splits = draw_splits(rows, "paper", seed)
    for roles in splits:
        shares = Counter(roles.values())
        assert abs(shares["val"] - len(rows) / 10) < 1
        assert abs(shares["test"] - len(rows) / 5) < 2
        for number, size in enumerate(sizes):
            tested = sum(roles[f"{number}-{k}"] == "test" for k in range(size))
            assert abs(tested - size / 5) < 2
    tested_in_all = [
        sum(role == "test" for roles in splits for role in [roles[row["sample_id"]]]) for row in rows
    ]
    assert tested_in_all == [1] * len(rows)


def test_states_of_a_pose_stay_together_and_no_trained_pose_is_near_a_tested_one() -> None:
    positions = np.array([(p.x_m, p.y_m) for p in half_ring()])
    apart_m = cdist(positions, positions)
    for roles in draw_splits(ALL, "by-pose", 0):
        of_pose = []
        for index in range(1353):
            states = {roles[f"p{index}-{state}"] for state in STATES}
            assert len(states) == 1
            of_pose.append(states.pop())
        role = np.array(of_pose)
        tested, trained = role == "test", np.isin(role, ["train", "val"])
        nearest_m = apart_m[:, tested].min(axis=1)
        assert nearest_m[trained].min() > 0.5
        # No pose is unused without need, and validation is an eighth of the free poses.
        assert nearest_m[role == "unused"].max() <= 0.5 + 1e-9
        assert tested.sum() == pytest.approx(1353 / 5, abs=2)
        assert (role == "val").sum() == pytest.approx(trained.sum() / 8, abs=1)
        assert {"orange", "red", "green", "yellow", "blue"} > {
            row["region"] for row in ALL if roles[row["sample_id"]] == "test"
        }


def test_a_fold_by_pose_tests_near_and_far_poses_of_different_bearings() -> None:
    for roles in draw_splits(ALL, "by-pose", 0):
        tested = [row for row in ALL if roles[row["sample_id"]] == "test"]
        assert len({row["distance_band"] for row in tested}) == 4
        distance_m = np.array([float(row["distance_m"]) for row in tested])
        bearing_deg = np.array([float(row["robot_angle_deg"]) for row in tested])
        far = distance_m > np.median(distance_m)
        assert abs(np.median(bearing_deg[far]) - np.median(bearing_deg[~far])) > 50


@pytest.mark.parametrize("protocol", ["paper", "by-pose"])
def test_splits_depend_on_the_seed(protocol: str) -> None:
    assert draw_splits(ALL, protocol, 1) == draw_splits(ALL, protocol, 1)
    assert draw_splits(ALL, protocol, 1) != draw_splits(ALL, protocol, 2)


def test_all_trains_on_everything() -> None:
    (roles,) = draw_splits(ALL, "all", 0)
    assert set(roles.values()) == {"train"}
    assert len(roles) == len(ALL)


def test_splits_read_back_from_their_file(tmp_path: Path) -> None:
    splits = draw_splits(rows_at(reduced_ring(60)), "by-pose", 0)
    assert "unused" in {role for roles in splits for role in roles.values()}
    write_splits(tmp_path / "splits.csv", splits)
    assert read_splits(tmp_path / "splits.csv") == splits


@pytest.mark.parametrize(
    ("content", "field"),
    [
        ("", None),
        ("sample_id,fold\na,train\n", None),
        ("sample_id,fold_0\n", None),
        ("sample_id,fold_0\na,tset\n", "fold_0"),
        ("sample_id,fold_0,fold_2\na,train,test\n", "fold_1"),
        ("sample_id,fold_0\na,train,test\n", None),
    ],
)
def test_a_damaged_file_of_splits_is_refused(tmp_path: Path, content: str, field: str | None) -> None:
    path = tmp_path / "splits.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(DatasetError, match=r"splits\.csv") as refused:
        read_splits(path)
    assert refused.value.field == field


def test_impossible_splits_are_refused() -> None:
    with pytest.raises(ConfigError, match="by-door") as refused:
        draw_splits(ALL, "by-door", 0)
    assert refused.value.field == "protocol"
    with pytest.raises(DatasetError, match="27 samples"):
        draw_splits(rows_at(list(range(9))), "paper", 0)
    # Ten neighbouring poses: all poses are too near to a tested one.
    with pytest.raises(DatasetError, match="none to train"):
        draw_splits(rows_at(list(range(10))), "by-pose", 0)


@pytest.mark.parametrize("missing", ["pose_id", "distance_m", "robot_angle_deg"])
def test_a_split_by_pose_needs_every_pose(missing: str) -> None:
    rows = rows_at(reduced_ring(60))
    for broken in (
        {name: value for name, value in rows[7].items() if name != missing},
        rows[7] | {"distance_m": ""},
    ):
        with pytest.raises(DatasetError, match=rows[7]["sample_id"]):
            draw_splits([*rows[:7], broken, *rows[8:]], "by-pose", 0)


def scene_rows(scenes: int) -> list[dict[str, str]]:
    kinds = ("single", "sliding", "double_equal")
    return [
        {
            "sample_id": f"{scene}-{state}",
            "scene_id": str(scene),
            "state": state,
            "door_kind": kinds[scene % 3],
            "distance_band": "1.5-2.0",
            "region": "green",
        }
        for scene in range(scenes)
        for state in STATES
    ]


def test_scenes_stay_together_and_kinds_are_spread_evenly() -> None:
    rows = scene_rows(60)
    splits = draw_splits(rows, "by-scene", 0)
    for roles in splits:
        by_scene = {(row["scene_id"], roles[row["sample_id"]]) for row in rows}
        assert len(by_scene) == 60
        tested = Counter(row["door_kind"] for row in rows if roles[row["sample_id"]] == "test")
        assert sum(tested.values()) == 36
        assert max(tested.values()) - min(tested.values()) <= 3
    tests = Counter(row["sample_id"] for row in rows for roles in splits if roles[row["sample_id"]] == "test")
    assert set(tests.values()) == {1}


def test_a_split_by_scene_needs_every_scene() -> None:
    rows = [*scene_rows(20), {"sample_id": "lost", "state": "open"}]
    with pytest.raises(DatasetError, match="lost") as refused:
        draw_splits(rows, "by-scene", 0)
    assert refused.value.field == "scene_id"


def test_small_data_sets_are_stratified_by_state() -> None:
    rows = rows_at(reduced_ring(12))
    for roles in draw_splits(rows, "paper", 0):
        tested = Counter(row["state"] for row in rows if roles[row["sample_id"]] == "test")
        # Two tenths of the twelve samples of a state, each within one sample of its share.
        assert all(abs(tested[state] - 12 / 5) < 2 for state in STATES)


def test_seeds_may_be_of_any_size() -> None:
    assert draw_splits(ALL, "paper", 2**40 + 1) == draw_splits(ALL, "paper", 2**40 + 1)
