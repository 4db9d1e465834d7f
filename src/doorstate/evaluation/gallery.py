# SPDX-License-Identifier: Apache-2.0
"""Cards of misclassified samples for the report: picture, cloud, facts and wrong predictions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import pandas as pd

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.errors import missed_by, order_errors
from doorstate.evaluation.results import PROBABILITY_COLUMNS, Results
from doorstate.evaluation.undecidable import is_undecidable
from doorstate.pages.encoding import encode_cloud, encode_detections, picture_uri

CARDS_PER_METHOD = 16
_DRAWN_POINTS = 2048


@dataclass(frozen=True)
class WrongPrediction:
    """Prediction of one method for a sample that it misclassified."""

    method: str
    fold: int
    predicted: str
    confidence: float | None  # probability of the predicted state; None without one
    probabilities: tuple[float, ...]  # in the order of `STATES`; none of a rule


@dataclass(frozen=True)
class SampleCard:
    """One sample that at least one method misclassified."""

    sample_id: str
    state: str
    undecidable: bool
    facts: tuple[str, ...]
    picture: str | None  # data URI
    predictions: tuple[WrongPrediction, ...]


@dataclass(frozen=True)
class Gallery:
    """Cards, the clouds they show (encoded for the page), and the number of errors of each method left out."""

    cards: tuple[SampleCard, ...]
    clouds: Mapping[str, Mapping[str, str | None]]
    detections: Mapping[str, Mapping[str, list[dict[str, Any]]]]  # by sample and method
    left_out: Mapping[str, int]

    @property
    def groups(self) -> list[tuple[str, list[SampleCard]]]:
        """Cards under headings: decidable samples by how many methods missed them, then the others."""

        def heading(card: SampleCard) -> str:
            return "Undecidable" if card.undecidable else missed_by(len(card.predictions), len(self.left_out))

        return [(title, list(cards)) for title, cards in groupby(self.cards, heading)]

    @property
    def detection_names(self) -> list[str]:
        """Names of the detections over all clouds."""
        by_method = (detections for methods in self.detections.values() for detections in methods.values())
        return sorted({detection["name"] for detections in by_method for detection in detections})


def build_gallery(results: Results, dataset: PreparedDataset) -> Gallery:
    """Choose the errors to show: of each method the decidable ones of highest confidence, a card for each sample.

    Args:
        results: a checked comparison.
        dataset: data set of the comparison.
    """
    errors = order_errors(results.errors)
    errors = errors.assign(undecidable=is_undecidable(errors))
    chosen = errors.groupby("method", sort=False).head(CARDS_PER_METHOD)["sample_id"].unique()
    kept = errors[errors["sample_id"].isin(chosen)]
    # In the order of methods, as `Results.errors` is.
    by_sample = {str(name): rows for name, rows in kept.sort_index().groupby("sample_id", sort=True)}
    order = sorted(
        by_sample, key=lambda name: (by_sample[name]["undecidable"].iloc[0], -len(by_sample[name]))
    )
    left_out = errors["method"].value_counts().sub(kept["method"].value_counts(), fill_value=0)
    cards, clouds = [], {}
    for name in order:  # picture and cloud of a sample follow each other, so that it is replayed once
        cards.append(_card(dataset, by_sample[name]))
        clouds[name] = _encode_cloud(dataset, dataset.index_of(name))
    return Gallery(
        cards=tuple(cards),
        clouds=clouds,
        detections={name: _detections(results, name, by_sample[name]["method"]) for name in order},
        left_out={method: int(left_out.get(method, 0)) for method in results.methods},
    )


def _card(dataset: PreparedDataset, errors: pd.DataFrame) -> SampleCard:
    first = errors.iloc[0]
    picture = dataset.image(dataset.index_of(first["sample_id"]))
    return SampleCard(
        first["sample_id"],
        first["state"],
        bool(first["undecidable"]),
        tuple(_facts(first)),
        None if picture is None else picture_uri(picture),
        tuple(
            WrongPrediction(
                row["method"],
                int(row["fold"]),
                row["predicted"],
                float(row["confidence"]) if row["confidence"] > 0 else None,
                tuple(float(row[name]) for name in PROBABILITY_COLUMNS if not pd.isna(row[name])),
            )
            for _, row in errors.iterrows()
        ),
    )


def _detections(results: Results, sample_id: str, methods: Iterable[str]) -> dict[str, list[dict[str, Any]]]:
    by_method = ((method, results.detections.get(method, {}).get(sample_id, ())) for method in methods)
    return {method: encode_detections(detections) for method, detections in by_method if detections}


def _facts(row: pd.Series[Any]) -> list[str]:
    """Return facts of a sample in words; missing columns are left out."""
    fields = row.dropna()
    facts = []
    if "opening_angle_deg" in fields:
        facts.append(f"opened {fields['opening_angle_deg']:.0f}°")
    if "distance_m" in fields:
        band = f" (band {fields['distance_band']} m)" if "distance_band" in fields else ""
        facts.append(f"{fields['distance_m']:.2f} m away{band}")
    if "robot_angle_deg" in fields:
        facts.append(f"seen from {fields['robot_angle_deg']:.0f}° ({fields.get('region', 'no region')})")
    if "visible_leaf_px" in fields:
        facts.append(f"{fields['visible_leaf_px']:.0f} leaf pixels")
    if "same_image_as" in fields:
        facts.append(f"same image as {fields['same_image_as'].replace(' ', ', ')}")
    return facts


def _encode_cloud(dataset: PreparedDataset, index: int) -> dict[str, str | None]:
    return encode_cloud(dataset.cloud(index, _DRAWN_POINTS), dataset.parts(index, _DRAWN_POINTS))
