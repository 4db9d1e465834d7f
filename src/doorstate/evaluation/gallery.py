# SPDX-License-Identifier: Apache-2.0
"""Misclassified samples as the report shows them: cards with picture, cloud, facts and wrong answers."""

from __future__ import annotations

import io
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.detections import encode_detections
from doorstate.evaluation.pages import data_uri, encode_cloud
from doorstate.evaluation.results import ComparisonResults, ErrorRow
from doorstate.evaluation.stratum_tables import is_undecidable

CARDS_PER_NETWORK = 16
_SHOWN_POINTS = 2048
_PICTURE_PX = (400, 300)


@dataclass(frozen=True)
class Card:
    """One sample that at least one network misclassified."""

    sample_id: str
    state: str
    undecidable: bool
    facts: tuple[str, ...]
    picture: str | None  # data URI
    answers: tuple[ErrorRow, ...]


@dataclass(frozen=True)
class Gallery:
    """Cards, the clouds they show (encoded for the page), and how many errors of a network are left out."""

    cards: tuple[Card, ...]
    clouds: Mapping[str, Mapping[str, str | None]]
    shapes: Mapping[str, Mapping[str, list[dict[str, Any]]]]  # by sample and method
    left_out: Mapping[str, int]

    @property
    def groups(self) -> list[tuple[str, list[Card]]]:
        """Cards under headings: decidable samples by how many methods missed them, then the others."""

        def heading(card: Card) -> str:
            return "Undecidable" if card.undecidable else missed_by(len(card.answers), len(self.left_out))

        return [(words, list(cards)) for words, cards in groupby(self.cards, heading)]


def missed_by(some: int, methods: int) -> str:
    """Heading of samples that so many of the methods were wrong about."""
    return f"Missed by {some or 'none'} of {methods}"


def build_gallery(results: ComparisonResults, dataset: PreparedDataset) -> Gallery:
    """Choose the errors to show: of each network the decidable ones it was surest of, a card for each sample.

    Args:
        results: a checked comparison.
        dataset: the prepared data set that it was trained on.
    """
    by_network: dict[str, list[ErrorRow]] = defaultdict(list)
    by_sample: dict[str, list[ErrorRow]] = defaultdict(list)
    for error in results.error_rows:
        by_network[error.network].append(error)
        by_sample[error.sample_id].append(error)
    rows = {name: dataset.rows[dataset.index_of(name)] for name in by_sample}
    chosen: set[str] = set()
    for errors in by_network.values():
        errors.sort(key=order_of_errors(dataset))
        chosen |= {error.sample_id for error in errors[:CARDS_PER_NETWORK]}
    order = sorted(chosen, key=lambda name: (is_undecidable(rows[name]), -len(by_sample[name]), name))
    left_out = Counter(error.network for error in results.error_rows if error.sample_id not in chosen)
    return Gallery(
        cards=tuple(_card(dataset, rows[name], tuple(by_sample[name])) for name in order),
        clouds={name: _encode_cloud(dataset, dataset.index_of(name)) for name in order},
        shapes={name: _shapes(results, by_sample[name]) for name in order},
        left_out={network: left_out[network] for network in results.networks},
    )


def order_of_errors(dataset: PreparedDataset) -> Callable[[ErrorRow], tuple[bool, float, str]]:
    """Key that sorts errors: decidable ones first, then by how sure the network was."""

    def key(error: ErrorRow) -> tuple[bool, float, str]:
        row = dataset.rows[dataset.index_of(error.sample_id)]
        return is_undecidable(row), -error.confidence, error.sample_id

    return key


def _card(dataset: PreparedDataset, row: Mapping[str, str], answers: tuple[ErrorRow, ...]) -> Card:
    picture = dataset.image(dataset.index_of(row["sample_id"]))
    return Card(
        row["sample_id"],
        row["state"],
        is_undecidable(row),
        tuple(_facts(row)),
        None if picture is None else picture_uri(picture),
        answers,
    )


def _shapes(results: ComparisonResults, errors: list[ErrorRow]) -> dict[str, list[dict[str, Any]]]:
    found = {error.network: results.shapes(error.network, error.sample_id) for error in errors}
    return {method: encode_detections(shapes) for method, shapes in found.items() if shapes}


def _facts(row: Mapping[str, str]) -> list[str]:
    """Say what the manifest knows; columns it lacks are passed over."""
    facts = []
    if angle := row.get("opening_angle_deg"):
        facts.append(f"opened {float(angle):.0f}°")
    if distance := row.get("distance_m"):
        band = f" (band {row['distance_band']} m)" if row.get("distance_band") else ""
        facts.append(f"{float(distance):.2f} m away{band}")
    if bearing := row.get("robot_angle_deg"):
        facts.append(f"seen from {float(bearing):.0f}° ({row.get('region') or 'no region'})")
    if leaf := row.get("visible_leaf_px"):
        facts.append(f"{leaf} leaf pixels")
    if twin := row.get("same_image_as"):
        facts.append(f"same image as {twin.replace(' ', ', ')}")
    return facts


def picture_uri(picture: NDArray[np.uint8]) -> str:
    """A small JPEG of (H, W, 3) pixels as an address."""
    image = Image.fromarray(picture)
    image.thumbnail(_PICTURE_PX)
    encoded = io.BytesIO()
    image.save(encoded, format="JPEG", quality=85)
    return data_uri(encoded.getvalue(), "image/jpeg")


def _encode_cloud(dataset: PreparedDataset, index: int) -> dict[str, str | None]:
    return encode_cloud(dataset.cloud(index, _SHOWN_POINTS), dataset.parts(index, _SHOWN_POINTS))
