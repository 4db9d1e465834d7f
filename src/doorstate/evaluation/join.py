# SPDX-License-Identifier: Apache-2.0
"""Join comparisons on the same samples: their methods side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import pandas as pd

from doorstate.errors import RunError
from doorstate.evaluation.results import Results, order_predictions


def join_results(parts: Sequence[Results]) -> Results:
    """Put the methods of comparisons on the same samples side by side, in the order given.

    Folds that one of them does not have are left out.

    Raises:
        RunError: they differ in protocol, points or splits, or a method is in two of them.
    """
    folds = min(part.config.folds for part in parts)
    first = parts[0]
    for part in parts[1:]:
        for name in ("protocol", "num_points"):
            if getattr(part.config, name) != getattr(first.config, name):
                raise RunError(
                    f"{part.config.name} has another {name} than {first.config.name}",
                    field=name,
                    hint="join comparisons of one kind only",
                )
        if part.splits[:folds] != first.splits[:folds]:
            raise RunError(
                f"{part.config.name} has other splits than {first.config.name}",
                hint="join comparisons of one kind only",
            )
    counts = Counter(method for part in parts for method in part.config.methods)
    if repeated := [method for method, count in counts.items() if count > 1]:
        raise RunError(f"{repeated[0]} is in two of these comparisons", hint="leave one out")
    config = first.config.model_copy(
        update={
            "name": " + ".join(part.config.name for part in parts),
            "folds": folds,
            "networks": tuple(name for part in parts for name in part.config.networks),
            "rules": tuple(name for part in parts for name in part.config.rules),
            "recipe": {key: value for part in parts for key, value in part.config.recipe.items()},
            "runs": {key: value for part in parts for key, value in part.config.runs.items()},
        }
    )
    predictions = pd.concat([part.predictions for part in parts], ignore_index=True)
    return Results(
        config,
        first.dataset_folder,
        first.manifest,
        first.splits,
        order_predictions(predictions[predictions["fold"] < folds], config),
        tuple(run for part in parts for run in part.runs if run.fold < folds),
        {method: detections for part in parts for method, detections in part.detections.items()},
    )
