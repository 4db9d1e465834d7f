# SPDX-License-Identifier: Apache-2.0
"""Paired tests between methods on the same samples."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests

from doorstate.evaluation.results import Results


def correct_by_method(results: Results) -> pd.DataFrame:
    """Return one row a tested sample and one column a method: True, False, or missing where it was not tested."""
    return results.tested.pivot(index="sample_id", columns="method", values="correct")[list(results.methods)]


def pairwise_tests(results: Results) -> pd.DataFrame:
    """Test each pair of methods with the exact McNemar test on the samples both were tested on.

    Returns:
        Columns first, second, samples, only_first_correct, only_second_correct, p, p_holm (adjusted for the number of
        pairs, Holm 1979).
    """
    correct = correct_by_method(results)
    rows = []
    for first, second in combinations(results.methods, 2):
        pair = correct[[first, second]].dropna().to_numpy(dtype=bool)
        only_first = int((pair[:, 0] & ~pair[:, 1]).sum())
        only_second = int((pair[:, 1] & ~pair[:, 0]).sum())
        rows.append(
            {
                "first": first,
                "second": second,
                "samples": len(pair),
                "only_first_correct": only_first,
                "only_second_correct": only_second,
                "p": mcnemar_p(only_first, only_second),
            }
        )
    columns = ["first", "second", "samples", "only_first_correct", "only_second_correct", "p"]
    tests = pd.DataFrame(rows, columns=columns)
    return tests.assign(p_holm=multipletests(tests["p"], method="holm")[1] if rows else tests["p"])


def mcnemar_p(only_first: int, only_second: int) -> float:
    """Return the two-sided p-value of the exact McNemar test from the two counts of discordant pairs."""
    return float(mcnemar(np.array([[0, only_first], [only_second, 0]]), exact=True).pvalue)
