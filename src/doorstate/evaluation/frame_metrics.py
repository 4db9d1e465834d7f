# SPDX-License-Identifier: Apache-2.0
"""What is counted of recorded frames: few, of few doors, some without a door, so that intervals say most."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.evaluation.metrics import (
    Interval,
    bootstrap_f1,
    confusion_matrix,
    grouped_interval,
    ratio,
    scores,
    wilson_interval,
)
from doorstate.types import ABSTAINED, PREDICTED_LABELS, STATES, Indices

_FEWEST_GROUPS = 5  # chosen: resamples of fewer are too much alike to say anything
Metrics = dict[str, Any]
"""As JSON takes it; what is undefined is None."""


class Said(NamedTuple):
    """An answer to one frame."""

    answer: str  # of `PREDICTED_LABELS`
    probability: float  # of this answer; 0 of none


def is_wrong(label: str, answer: str) -> bool:
    """Whether an answer is not the state, or is a state where there is none to tell."""
    return answer != label if label in STATES else answer != ABSTAINED


def measure(
    labels: Sequence[str],
    groups: Sequence[str],
    strata: Mapping[str, Sequence[str]],
    said: Mapping[str, Sequence[Said]],
) -> Metrics:
    """Count the answers of every method.

    Args:
        labels: N states, or other words for frames without a clear door.
        groups: N names; frames of one name depend on each other.
        strata: by name, N values by which frames are told apart.
        said: by method, N answers.

    Returns:
        `frames`, `groups`, `states`, `constant` (the scores of the most frequent state said of every frame) and
        `methods`, of which each has `all`, `by` and `without_a_door`.
    """
    labelled = np.array([label in STATES for label in labels], dtype=np.bool_)
    true = np.array([STATES.index(label) for label in labels if label in STATES], dtype=np.int64)
    named = np.array(list(groups), dtype=object)[labelled].tolist()
    counts = Counter(STATES[state] for state in true)
    most = counts.most_common(1)[0][0] if counts else STATES[0]
    methods = {}
    for method, answers in said.items():
        given = np.array([PREDICTED_LABELS.index(each.answer) for each in answers], dtype=np.int64)
        methods[method] = {
            "all": _score(true, given[labelled], named),
            "by": {
                name: _stratified(
                    true, given[labelled], named, np.array(list(values), dtype=object)[labelled]
                )
                for name, values in strata.items()
            },
            "without_a_door": {
                label: _without([each for each, own in zip(answers, labels, strict=True) if own == label])
                for label in dict.fromkeys(label for label in labels if label not in STATES)
            },
        }
    return {
        "frames": int(labelled.sum()),
        "groups": len(set(named)),
        "states": {state: counts[state] for state in STATES},
        "constant": {
            "answer": most,
            "all": _score(true, np.full_like(true, STATES.index(most)), named),
        },
        "methods": methods,
    }


def _stratified(true: Indices, given: Indices, groups: Sequence[str], values: NDArray[Any]) -> Metrics:
    parts = {str(value): np.flatnonzero(values == value) for value in dict.fromkeys(values.tolist())}
    return {
        value: _score(true[part], given[part], [groups[int(number)] for number in part])
        for value, part in parts.items()
    }


def _score(true: Indices, given: Indices, groups: Sequence[str]) -> Metrics:
    confusion = confusion_matrix(true, given)
    right = true == given
    macro_f1 = float(scores(confusion).macro.f1)
    states = {}
    for number, state in enumerate(STATES):
        of_state = true == number
        states[state] = _share(right[of_state], [groups[int(each)] for each in np.flatnonzero(of_state)])
    return {
        **_share(right, groups),
        "abstained": int((given == PREDICTED_LABELS.index(ABSTAINED)).sum()),
        "macro_f1": _defined(macro_f1),
        "macro_f1_interval": _bootstrapped(true, given, list(map(str, range(len(true))))),
        "macro_f1_interval_by_group": _bootstrapped(true, given, groups),
        "states": states,
        "confusion": confusion.tolist(),
    }


def _bootstrapped(true: Indices, given: Indices, groups: Sequence[str]) -> list[float] | None:
    if len(set(groups)) < _FEWEST_GROUPS:
        return None
    return _interval(bootstrap_f1(true, given, groups, np.random.default_rng(0)).macro)


def _share(right: NDArray[np.bool_], groups: Sequence[str]) -> Metrics:
    hits = int(right.sum())
    return {
        "frames": len(right),
        "groups": len(set(groups)),
        "right": hits,
        "share": _defined(float(ratio(hits, len(right)))),
        "interval": _interval(wilson_interval(hits, len(right))),
        "interval_by_group": _interval(grouped_interval(right, groups)),
    }


def _without(answers: Sequence[Said]) -> Metrics:
    given = [each for each in answers if each.answer != ABSTAINED]
    counts = Counter(each.answer for each in given)
    sure = [each.probability for each in given]
    return {
        "frames": len(answers),
        "given_a_state": len(given),
        "share": _defined(float(ratio(len(given), len(answers)))),
        "interval": _interval(wilson_interval(len(given), len(answers))),
        "states": {state: counts[state] for state in STATES},
        "median_probability": _defined(float(np.median(sure)) if sure else math.nan),
        "largest_probability": _defined(max(sure, default=math.nan)),
    }


def _defined(value: float) -> float | None:
    return None if math.isnan(value) else value


def _interval(low_high: Interval) -> list[float] | None:
    return None if math.isnan(low_high[0]) else list(low_high)
