# SPDX-License-Identifier: Apache-2.0
"""Weights before and after an adaptation on the frames that were held out, and the card that says so."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from doorstate._jobs import Progress, WorkersOrEngine, no_progress
from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation.frame_pieces import PredictorArguments, evaluate_frames_in_pieces
from doorstate.evaluation.frame_scores import FrameScores
from doorstate.evaluation.table import (
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number_column,
)
from doorstate.training.adaptation.adapt import Adaptation, AdaptedWeights

BEFORE, AFTER = "before", "after"
_DOOR = "door"


def score_before_and_after(
    before: Path,
    after: Path,
    held_out: Sequence[LabelledFrame],
    workers: WorkersOrEngine = 1,
    folder: Path | None = None,
    progress: Progress = no_progress,
) -> FrameScores | None:
    """Score two weights files on the same frames; None without a frame that can be read.

    Args:
        before: weights file that the adaptation began with.
        after: adapted weights file.
        held_out: frames that were not trained on.
        workers: number of processes on this machine, None for one a processor, or an engine.
        folder: folder for temporary files, as for `map_pieces`.
        progress: called with pieces done and pieces in all.
    """
    methods = PredictorArguments({BEFORE: {"name_or_path": before}, AFTER: {"name_or_path": after}})
    results = evaluate_frames_in_pieces(methods, held_out, workers, folder, progress)
    if not results.frames:
        return None
    return results.score(_DOOR if all(frame.columns.get(_DOOR) for frame in results.frames) else None)


def before_and_after_table(scores: FrameScores) -> Table:
    """Build the table of both weights on the held-out frames."""
    rows = scores.scores[scores.scores["method"].isin((BEFORE, AFTER))]
    frame = rows.assign(
        answered=rows["frames"] - rows["abstained"],
        wrong=rows["frames"] - rows["abstained"] - rows["correct"],
    )
    columns: tuple[Column, ...] = (
        label_column("method", "weights"),
        count_column("frames"),
        count_column("answered"),
        count_column("correct"),
        count_column("wrong"),
        number_column("accuracy", digits=2),
        interval_column("accuracy", "95 %", 2),
        number_column("f1", "macro F1", 2),
        interval_column("f1", "95 %", 2),
    )
    note = "Frames of one door or moment depend on each other, so that the intervals are too narrow."
    return Table.from_frame("Held-out frames", frame, columns, note)


def adaptation_card(
    name: str, adaptation: Adaptation, adapted: AdaptedWeights, scores: FrameScores | None, left_out: int
) -> str:
    """Return the card of adapted weights as Markdown.

    Args:
        name: name of the weights file.
        adaptation: adaptation that made them.
        adapted: the weights.
        scores: of the held-out frames; None if none were held out.
        left_out: frames that could not be used.
    """
    held_out, card, recipe = adaptation.held_out, adapted.card, adaptation.recipe
    doors = sorted({frame.columns.get(_DOOR, "") for frame in held_out} - {""})
    number, steps = (
        len(adaptation.frames),
        recipe.epochs * (recipe.clouds_per_epoch or 0) // recipe.batch_size,
    )
    before, after = adapted.simulated_f1_before, adapted.simulated_f1_after
    lines = [
        f"# {name}",
        "",
        f"Network `{card.network}`, adapted to {number - len(held_out)} of {number} labelled frames; "
        f"{left_out} frames could not be used. Began with `{adaptation.weights.name}`: {adaptation.card.trained_on}.",
        "",
        f"- Held out: {len(held_out)} frames" + (f", doors {', '.join(doors)}." if doors else "."),
        f"- Training: {steps} steps of {recipe.batch_size} clouds, {recipe.own_share:.0%} of them from the place, at a "
        f"rate of {recipe.learning_rate:g}, with frozen statistics; "
        f"{adapted.share:.0%} of the way from the first weights to the trained ones.",
        f"- Simulated doors, held out: macro-F1 {before:.3f} before, {after:.3f} after.",
        f"- Temperature {card.temperature:g}; no answer below a probability of {card.abstain_below:g}.",
        "",
    ]
    if scores is None:
        lines.append(
            "No frame was held out, so that there is no figure of how well these weights know the place."
        )
    else:
        lines.append(before_and_after_table(scores).to_markdown())
    return "\n".join(lines).rstrip() + "\n"
