# SPDX-License-Identifier: Apache-2.0
"""HTML page with scores on labelled frames, and the frames with their predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

from doorstate import __version__
from doorstate._jobs import Progress, no_progress
from doorstate.dataset.frame_index import PLACE_COLUMNS
from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation.errors import missed_by
from doorstate.evaluation.frames import FrameResults, Predictors
from doorstate.evaluation.table import Table
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.inference.serialization import prediction_to_dict
from doorstate.pages.colors import DETECTION_COLORS, STATE_COLORS
from doorstate.pages.render import render_page
from doorstate.types import STATES
from doorstate.viewer.cloud_page import CHANNEL_STEPS, Entry, make_entry
from doorstate.viewer.frame_pictures import frame_pictures
from doorstate.viewer.named_clouds import NamedCloud

MAX_CARDS = 200
ShownFrames = Literal["errors", "all", "changed"]
CHANGES = ("broken", "corrected", "changed")  # the order on the page
# Columns of the index that are not listed on a card: camera, file names, origin and place.
_HIDDEN_COLUMNS = {
    "rgb",
    "width",
    "height",
    "fx",
    "fy",
    "cx",
    "cy",
    "depth_unit_m",
    "axes",
    "roll_deg",
    "pitch_deg",
    "quaternion",
    "source",
    "licence",
    "camera_height_m",
    "topic",
    "stamp_s",
    *PLACE_COLUMNS,
}


@dataclass(frozen=True)
class FrameCard:
    """One frame on the page.

    Attributes:
        file: file of the frame.
        label: true state, or another label of a frame without a clear door.
        facts: texts from the other columns of the index.
        pictures: data URIs by name.
        entries: cloud and prediction of each method.
        misclassified_by: methods that were wrong.
        change: how the last method changes what the first one says.
    """

    file: str
    label: str
    facts: tuple[str, ...]
    pictures: Mapping[str, str]
    entries: Mapping[str, Entry]
    misclassified_by: tuple[str, ...]
    change: str = ""


def choose_frames(results: FrameResults, shown: ShownFrames = "errors", limit: int = MAX_CARDS) -> list[int]:
    """Return the numbers of the frames to show: those with most wrong methods first, changes by their kind.

    Args:
        results: predictions for the frames.
        shown: frames that a method got wrong, all frames, or those of which the first and the last method say different
            things.
        limit: largest number of frames.
    """
    numbers = range(len(results.frames))
    if shown == "changed":
        kinds = {number: kind for number in numbers if (kind := results.change_of(number))}
        return sorted(kinds, key=lambda number: CHANGES.index(kinds[number]))[:limit]
    misses = [len(results.misclassified_by(number)) for number in numbers]
    candidates = [number for number, count in enumerate(misses) if shown == "all" or count]
    return sorted(candidates, key=lambda number: -misses[number])[:limit]


def make_cards(
    results: FrameResults, predictors: Predictors, numbers: Sequence[int], progress: Progress = no_progress
) -> list[FrameCard]:
    """Read frames again, and return a card for each.

    Args:
        results: predictions for the frames.
        predictors: predictors by name.
        numbers: numbers of the frames, from `choose_frames`.
        progress: called after each frame.
    """
    cards = []
    for done, number in enumerate(numbers, 1):
        frame = results.frames[number]
        cloud, pose = frame.read()
        truth = frame.label if frame.label in STATES else ""
        named = NamedCloud(frame.name, cloud, truth=truth, pose=pose)
        cards.append(
            FrameCard(
                file=frame.name,
                label=frame.label,
                facts=_facts(frame),
                pictures=frame_pictures(frame, cloud),
                entries={
                    name: _entry(predictor, named, frame, results.outputs[name][number])
                    for name, predictor in predictors.items()
                },
                misclassified_by=tuple(results.misclassified_by(number)),
                change=results.change_of(number),
            )
        )
        progress(done, len(numbers))
    return cards


def _entry(predictor: Predictor, named: NamedCloud, frame: LabelledFrame, prediction: Prediction) -> Entry:
    """Return the entry of a frame; of a labelled door, with the prediction for its place."""
    entry = make_entry(predictor, named)
    if frame.doorway is None or "error" in entry:
        return entry
    return entry | {"prediction": prediction_to_dict(prediction)}


def render_frame_page(
    title: str,
    tables: Mapping[str, Table],
    results: FrameResults,
    cards: Sequence[FrameCard],
    notes: Sequence[str] = (),
    shown: ShownFrames = "errors",
) -> str:
    """Return the page.

    Args:
        title: name of the folder.
        tables: tables from `frame_tables`.
        results: predictions for the frames.
        cards: cards from `make_cards`.
        notes: notes to read before the numbers.
        shown: frames that were chosen.
    """
    misclassified = sum(bool(results.misclassified_by(number)) for number in range(len(results.frames)))
    return render_page(
        "frames.html.j2",
        "doorstate.viewer",
        title=title,
        version=__version__,
        tables=tables,
        notes=notes,
        groups=_groups_of_changes(cards) if shown == "changed" else _groups(cards, len(results.outputs)),
        shown=shown,
        num_cards=len(cards),
        num_left_out=misclassified - sum(bool(card.misclassified_by) for card in cards),
        num_frames=len(results.frames),
        methods=list(results.outputs),
        unreadable=results.unreadable,
        states=STATES,
        state_colors=STATE_COLORS,
        detection_colors=_detection_colors(cards),
        page_data={
            "cards": {
                card.file: {name: _drawing(entry) for name, entry in card.entries.items()} for card in cards
            },
            "channel_steps": CHANNEL_STEPS,
        },
    )


def _groups(cards: Sequence[FrameCard], methods: int) -> list[tuple[str, list[FrameCard]]]:
    """Return the cards under headings, by the number of wrong methods."""
    by_misses = groupby(cards, lambda card: len(card.misclassified_by))
    return [(missed_by(misses, methods), list(group)) for misses, group in by_misses]


def _groups_of_changes(cards: Sequence[FrameCard]) -> list[tuple[str, list[FrameCard]]]:
    """Return the cards under headings, by the kind of the change."""
    groups = [(kind, [card for card in cards if card.change == kind]) for kind in CHANGES]
    return [(f"{len(group)} {kind}", group) for kind, group in groups if group]


def _drawing(entry: Entry) -> Entry:
    """Return the fields of an entry that the script of the page draws."""
    return {name: entry[name] for name in ("cloud", "detections", "channels") if name in entry}


def _detection_colors(cards: Sequence[FrameCard]) -> dict[str, str]:
    """Return the colours of all detections on the cards, by name."""
    entries = [entry for card in cards for entry in card.entries.values()]
    names = {detection["name"] for entry in entries for detection in entry.get("detections", [])}
    return {name: DETECTION_COLORS.get(name, DETECTION_COLORS["edge"]) for name in sorted(names)}


def _facts(frame: LabelledFrame) -> tuple[str, ...]:
    columns = {name: value for name, value in frame.columns.items() if value and name not in _HIDDEN_COLUMNS}
    return tuple(f"{name.replace('_', ' ')}: {value}" for name, value in columns.items())
