# SPDX-License-Identifier: Apache-2.0
"""Counts of a few recorded frames, by hand, and intervals that know which frames depend on each other."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.evaluation.frame_metrics import Metrics, Said, is_wrong, measure
from doorstate.evaluation.frame_tables import frame_notes, frame_tables
from doorstate.evaluation.metrics import grouped_interval, wilson_interval
from doorstate.types import ABSTAINED

LABELS = ["closed", "closed", "closed", "closed", "semi_open", "open", "no_door", "no_door", "openings"]
DOORS = ["a", "a", "b", "c", "d", "e", "/1", "/2", "/3"]
SENSORS = ["xtion"] * 5 + ["d435"] * 4
SAID = [
    Said("closed", 0.9),
    Said("closed", 0.8),
    Said("open", 0.6),
    Said(ABSTAINED, 0.0),
    Said("semi_open", 0.7),
    Said("open", 0.5),
    Said("closed", 0.9),
    Said("semi_open", 0.5),
    Said(ABSTAINED, 0.0),
]


@pytest.fixture
def metrics() -> Metrics:
    return measure(LABELS, DOORS, {"sensor": SENSORS}, {"net": SAID})


@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_independent_samples_have_wilsons_interval(right: list[bool]) -> None:
    found = grouped_interval(np.array(right), [str(number) for number in range(len(right))])
    assert found == pytest.approx(wilson_interval(sum(right), len(right)), abs=1e-9)


@given(st.lists(st.booleans(), min_size=1, max_size=12), st.integers(2, 5))
def test_frames_that_repeat_their_door_add_nothing(right: list[bool], copies: int) -> None:
    groups = [str(number) for number in range(len(right)) for _ in range(copies)]
    found = grouped_interval(np.repeat(right, copies), groups)
    assert found == pytest.approx(wilson_interval(sum(right), len(right)), abs=1e-9)


def test_one_large_group_counts_for_little_more_than_one() -> None:
    right = np.array([True] * 10 + [False] * 5)
    low, high = grouped_interval(right, ["lab"] * 13 + ["x", "y"])
    assert low < 0.15
    assert high > 0.95
    assert all(math.isnan(value) for value in grouped_interval(np.array([], dtype=np.bool_), []))


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_intervals_of_groups_contain_the_share(seed: int) -> None:
    rng = np.random.default_rng(seed)
    right, groups = rng.random(20) < 0.5, rng.integers(0, 6, 20).astype(str).tolist()
    low, high = grouped_interval(right, groups)
    assert 0 <= low <= right.mean() <= high <= 1


def test_counts_by_hand(metrics: Metrics) -> None:
    assert (metrics["frames"], metrics["groups"]) == (6, 5)
    assert metrics["states"] == {"closed": 4, "semi_open": 1, "open": 1}
    found = metrics["methods"]["net"]["all"]
    assert (found["frames"], found["right"], found["abstained"]) == (6, 4, 1)
    assert found["confusion"] == [[2, 0, 1, 1], [0, 1, 0, 0], [0, 0, 1, 0]]
    closed = found["states"]["closed"]
    assert (closed["right"], closed["frames"], closed["groups"], closed["share"]) == (2, 4, 3, 0.5)
    # F1: closed 2*2/(4+2), semi-open 1, open 2/(1+2).
    assert found["macro_f1"] == pytest.approx((2 / 3 + 1 + 2 / 3) / 3)
    assert found["macro_f1_interval"][0] <= found["macro_f1"] <= found["macro_f1_interval"][1]


def test_frames_without_a_door_are_counted_apart(metrics: Metrics) -> None:
    apart = metrics["methods"]["net"]["without_a_door"]
    assert list(apart) == ["no_door", "openings"]
    assert (apart["no_door"]["frames"], apart["no_door"]["given_a_state"]) == (2, 2)
    assert apart["no_door"]["states"] == {"closed": 1, "semi_open": 1, "open": 0}
    assert (apart["no_door"]["median_probability"], apart["no_door"]["largest_probability"]) == (0.7, 0.9)
    assert (apart["openings"]["given_a_state"], apart["openings"]["median_probability"]) == (0, None)


def test_strata_add_up(metrics: Metrics) -> None:
    parts = metrics["methods"]["net"]["by"]["sensor"]
    assert {name: (part["right"], part["frames"]) for name, part in parts.items()} == {
        "xtion": (3, 5),
        "d435": (1, 1),
    }


def test_what_always_says_the_same_stands_beside(metrics: Metrics) -> None:
    assert metrics["constant"]["answer"] == "closed"
    assert metrics["constant"]["all"]["right"] == 4
    rows = frame_tables(metrics, "door")["scores"].rows
    assert [row[0] for row in rows] == ["net", "always closed"]


def test_too_few_doors_give_no_interval_of_f1() -> None:
    found = measure(LABELS, ["a"] * 4 + ["b"] * 5, {}, {"net": SAID})["methods"]["net"]["all"]
    assert found["macro_f1_interval_by_group"] is None
    assert found["macro_f1_interval"] is not None
    assert found["interval_by_group"][1] - found["interval_by_group"][0] > 0.7


def test_metrics_are_plain_json_also_where_nothing_is_defined() -> None:
    empty = measure(["no_door"], ["x"], {"s": ["y"]}, {"net": [Said("open", 0.4)]})
    assert json.loads(json.dumps(empty, allow_nan=False)) == empty
    assert frame_notes(empty) == ["No frame shows a door whose state is known."]
    assert list(frame_tables(empty)) == ["without_a_door"]
    assert measure(LABELS, DOORS, {}, {"net": SAID}) == measure(LABELS, DOORS, {}, {"net": SAID})


def test_tables_have_a_cell_for_every_column(metrics: Metrics) -> None:
    for group in ("door", "frame"):
        tables = frame_tables(metrics, group)
        assert list(tables) == ["scores", "recall", "confusion", "by_sensor", "without_a_door"]
        for table in tables.values():
            assert {len(row) for row in table.rows} == {len(table.columns)}
    assert "a door as one" in " ".join(frame_tables(metrics, "door")["scores"].columns)
    assert "as one" not in " ".join(frame_tables(metrics)["scores"].columns)
    assert frame_notes(metrics, "door")[0].startswith(
        "6 frames with a door of 5 doors, as column door names them"
    )


def test_a_state_is_wrong_where_there_is_no_door() -> None:
    assert is_wrong("closed", "open")
    assert is_wrong("closed", ABSTAINED)
    assert is_wrong("no_door", "closed")
    assert not is_wrong("no_door", ABSTAINED)
    assert not is_wrong("open", "open")
