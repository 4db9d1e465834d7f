# SPDX-License-Identifier: Apache-2.0
"""Published results by name of their experiment, each read once."""

from __future__ import annotations

from functools import cache

from doorstate.evaluation.predictions import join_results, load_results
from doorstate.evaluation.results import Results
from doorstate.evaluation.study import StudyResults, load_study_results

from . import paths

BESIDE = {"related": "paper"}
"""Comparisons that are shown beside the methods of another one."""


@cache
def comparison(name: str) -> Results:
    """Return a published comparison."""
    return load_results(paths.RESULTS / name)


@cache
def side_by_side(name: str) -> Results:
    """Return a published comparison with the one that it is shown beside, if any."""
    first = BESIDE.get(name)
    return join_results([comparison(first), comparison(name)]) if first else comparison(name)


@cache
def study(name: str) -> StudyResults:
    """Return a published study."""
    return load_study_results(paths.RESULTS / name)
