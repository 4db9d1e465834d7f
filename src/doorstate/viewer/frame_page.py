# SPDX-License-Identifier: Apache-2.0
"""Labelled frames and what was said of them, as one HTML page that loads nothing from anywhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from doorstate import __version__
from doorstate._jobs import Progress, no_progress
from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation.frames import FrameResults, Predictors
from doorstate.evaluation.gallery import missed_by, picture_uri
from doorstate.evaluation.pages import render_page
from doorstate.evaluation.table import Table
from doorstate.evaluation.views import DETECTION_COLORS, STATE_COLORS
from doorstate.types import STATES, Points
from doorstate.viewer.cloud_page import CHANNEL_STEPS, Entry, make_entry
from doorstate.viewer.named_clouds import NamedCloud

MOST_CARDS = 200
_DEPTH_SHARES = (0.02, 0.98)  # of the pixels; outliers would take all colours
_NOT_TOLD = {
    "rgb",
    "width",
    "height",
    "fx",
    "fy",
    "cx",
    "cy",
    "depth_unit_m",
    "frame",
    "roll_deg",
    "source",
    "licence",
}
_NOTHING = (70, 70, 70)  # where nothing was measured


@dataclass(frozen=True)
class FrameCard:
    """One frame."""

    file: str
    label: str
    facts: tuple[str, ...]
    pictures: Mapping[str, str]  # data URIs by what they show
    views: Mapping[str, Entry]  # by method
    wrong: tuple[str, ...]


def choose_frames(results: FrameResults, everything: bool, most: int = MOST_CARDS) -> list[int]:
    """Numbers of the frames to show: those that most methods missed first, then in their order.

    Args:
        results: predictions for the frames.
        everything: also those about which all were right.
        most: no more than these.
    """
    missed = {number: len(results.misclassified_by(number)) for number in range(len(results.frames))}
    chosen = sorted(
        (number for number in missed if everything or missed[number]), key=lambda each: -missed[each]
    )
    return chosen[:most]


def frame_cards(
    results: FrameResults, predictors: Predictors, chosen: Sequence[int], progress: Progress = no_progress
) -> list[FrameCard]:
    """Read the chosen frames again, and look at what every method looked at.

    Args:
        results: predictions for the frames.
        predictors: by name.
        chosen: numbers of frames.
        progress: told after each.
    """
    cards = []
    for done, number in enumerate(chosen, 1):
        frame = results.frames[number]
        cloud = frame.read()
        named = NamedCloud(frame.file, cloud, truth=frame.label if frame.label in STATES else "")
        cards.append(
            FrameCard(
                frame.file,
                frame.label,
                tuple(f"{name.replace('_', ' ')}: {value}" for name, value in _told(frame).items()),
                _pictures(frame, cloud),
                {name: make_entry(method, named) for name, method in predictors.items()},
                tuple(results.misclassified_by(number)),
            )
        )
        progress(done, len(chosen))
    return cards


def render_frame_page(
    title: str,
    tables: Mapping[str, Table],
    results: FrameResults,
    cards: Sequence[FrameCard],
    notes: Sequence[str] = (),
) -> str:
    """The page.

    Args:
        title: name of the folder.
        tables: of `frame_tables`.
        results: predictions for the frames.
        cards: of `frame_cards`.
        notes: to be read before the numbers.
    """
    return render_page(
        "frames.html.j2",
        "doorstate.viewer",
        title=title,
        version=__version__,
        tables=tables,
        notes=notes,
        groups=_groups(cards, len(results.outputs)),
        shown=len(cards),
        left_out=sum(bool(results.misclassified_by(number)) for number in range(len(results.frames)))
        - sum(bool(card.wrong) for card in cards),
        total=len(results.frames),
        methods=list(results.outputs),
        unreadable=results.unreadable,
        states=STATES,
        state_colors=STATE_COLORS,
        shapes=_shapes(cards),
        page_data={
            "cards": {card.file: {name: _drawn(view) for name, view in card.views.items()} for card in cards},
            "channel_steps": CHANNEL_STEPS,
        },
    )


def _groups(cards: Sequence[FrameCard], methods: int) -> list[tuple[str, list[FrameCard]]]:
    """Cards of `choose_frames` under headings."""
    by_missed = groupby(cards, lambda card: len(card.wrong))
    return [(missed_by(missed, methods), list(some)) for missed, some in by_missed]


def _drawn(view: Entry) -> Entry:
    return {name: view[name] for name in ("cloud", "shapes", "channels") if name in view}


def _shapes(cards: Sequence[FrameCard]) -> dict[str, str]:
    """Colours of the shapes that are drawn."""
    names = {
        shape["name"] for card in cards for view in card.views.values() for shape in view.get("shapes", [])
    }
    return {name: DETECTION_COLORS.get(name, DETECTION_COLORS["edge"]) for name in sorted(names)}


def _told(frame: LabelledFrame) -> dict[str, str]:
    """What the index knows that a reader wants to know: not the camera, not file names."""
    return {name: value for name, value in frame.columns.items() if value and name not in _NOT_TOLD}


def _pictures(frame: LabelledFrame, cloud: Points) -> dict[str, str]:
    pictures = {}
    colour = frame.columns.get("rgb", "")
    if colour and (frame.folder / colour).is_file():
        # A picture to look at is no reason to lose the page.
        with suppress(OSError), Image.open(frame.folder / colour) as image:
            pictures["colour"] = picture_uri(np.asarray(image.convert("RGB")))
    if cloud.ndim == 3:
        pictures["depth"] = picture_uri(_depth_picture(cloud))
    return pictures


def _depth_picture(cloud: Points) -> NDArray[np.uint8]:
    """(H, W, 3) of an organized cloud: near is bright, grey is not measured."""
    depth_m = cloud[..., 0].astype(np.float64)
    seen = np.isfinite(depth_m) & (depth_m != 0)
    picture = np.full((*depth_m.shape, 3), _NOTHING, dtype=np.uint8)
    if seen.any():
        near_m, far_m = np.quantile(depth_m[seen], _DEPTH_SHARES)
        share = np.clip((depth_m[seen] - near_m) / max(1e-6, far_m - near_m), 0, 1)
        picture[seen] = (mpl.colormaps["viridis_r"](share)[:, :3] * 255).astype(np.uint8)
    return picture
