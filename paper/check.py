# SPDX-License-Identifier: Apache-2.0
"""Check that published numbers follow from the committed predictions."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.results import Results

from . import paths
from .definition import read_definitions
from .pages.render import outdated_pages
from .published import comparison, study

LARGEST_PICTURE = 200_000  # bytes


def check() -> list[str]:
    """Return what does not follow from `results/`; empty if everything does.

    The pages of `docs/` are rendered again and compared; scores in `metrics.json` are computed again from the
    predictions; pictures that pages show are checked for presence and size.
    """
    return [
        *(f"{name}: {problem}" for name, results in published() for problem in wrong_metrics(results)),
        *(f"docs/{name}.md: differs from its results" for name in outdated_pages()),
        *wrong_pictures(),
    ]


def published() -> Iterator[tuple[str, Results]]:
    """Yield every published comparison and every part of a published study, with its name."""
    for definition in read_definitions():
        if not (paths.RESULTS / definition.name).is_dir():
            continue
        if definition.is_study:
            for part, results in study(definition.name).parts.items():
                yield f"{definition.name}/{part}", results
        else:
            yield definition.name, comparison(definition.name)


def wrong_metrics(results: Results) -> Iterator[str]:
    """Yield the runs whose recorded scores differ from those of their predictions."""
    for run in results.runs:
        rows = results.tested_by(run.method)
        rows = rows[rows["fold"] == run.fold]
        # Undefined scores count as 0 where runs record them.
        scores = {"test_macro_f1": macro_f1(rows), "test_accuracy": rows["correct"].mean()}
        for name, value in scores.items():
            if not math.isclose(run.metric(name), 0.0 if math.isnan(value) else value, abs_tol=1e-9):
                yield f"{run.method}, fold {run.fold}: {name} is recorded as {run.metric(name)}, not {value}"


def wrong_pictures() -> Iterator[str]:
    """Yield the pictures of `docs/images` that are missing, unused or too large."""
    text = "".join(
        path.read_text(encoding="utf-8")
        for path in (*paths.DOCS.rglob("*.md"), paths.REPOSITORY / "README.md")
    )
    used = set(re.findall(r"images/([\w-]+\.png)", text))
    tracked = {path.name: path for path in (paths.DOCS / "images").iterdir()}
    for name in sorted(used | set(tracked)):
        if name not in tracked:
            yield f"docs/images/{name}: is missing"
        elif name not in used:
            yield f"docs/images/{name}: is shown on no page"
        elif tracked[name].stat().st_size > LARGEST_PICTURE:
            yield f"docs/images/{name}: is larger than {LARGEST_PICTURE} bytes"
