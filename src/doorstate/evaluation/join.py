# SPDX-License-Identifier: Apache-2.0
"""Several comparisons on the same samples as one: networks beside the methods of the related work."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from doorstate.errors import RunError
from doorstate.evaluation.results import ComparisonResults, load_results


def load_joined(
    comparison_folders: Sequence[Path], dataset_folder: Path | None = None, folds: int | None = None
) -> ComparisonResults:
    """Read comparisons as `load_results` does and put their methods side by side, in the order given.

    Args:
        comparison_folders: at least one.
        dataset_folder: their data set, if it is not where the first says.
        folds: read the first so many folds only; never more than every comparison has.

    Raises:
        RunError: one cannot be used, they differ in protocol, points or splits, or a method is in two of them.
    """
    parts = [load_results(folder, dataset_folder, folds) for folder in comparison_folders]
    fewest = min(part.comparison.folds for part in parts)
    first, *others = [_first_folds(part, fewest) for part in parts]
    for folder, other in zip(comparison_folders[1:], others, strict=True):
        for name in ("protocol", "num_points"):
            if getattr(other.comparison, name) != getattr(first.comparison, name):
                raise RunError(
                    f"{folder}: has another {name} than {comparison_folders[0]}; join like with like"
                )
        if other.splits[:fewest] != first.splits[:fewest]:
            raise RunError(f"{folder}: has other folds than {comparison_folders[0]}; join like with like")
    every = (first, *others)
    counts = Counter(method for part in every for method in part.comparison.methods)
    if twice := [method for method, count in counts.items() if count > 1]:
        raise RunError(f"{twice[0]} is in two of these comparisons; leave one out")
    comparison = replace(
        first.comparison,
        name=" + ".join(part.comparison.name for part in every),
        networks=tuple(network for part in every for network in part.comparison.networks),
        rules=tuple(rule for part in every for rule in part.comparison.rules),
    )
    return replace(first, comparison=comparison, runs=tuple(run for part in every for run in part.runs))


def _first_folds(results: ComparisonResults, folds: int) -> ComparisonResults:
    comparison = replace(results.comparison, folds=folds)
    return replace(
        results, comparison=comparison, runs=tuple(run for run in results.runs if run.fold < folds)
    )
