# SPDX-License-Identifier: Apache-2.0
"""Adaptation of weights to labelled frames of a place: prepare, simulate, train, keep, calibrate, write.

Every step continues where it was stopped: each has its files in one folder, named by what the adaptation began with.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from doorstate._devices import resolve_device
from doorstate._jobs import Progress, WorkersOrEngine, no_progress
from doorstate.dataset.digests import file_digest
from doorstate.dataset.labelled import LabelledFrame
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.networks.card import WeightsCard
from doorstate.networks.card_file import check_card, read_card
from doorstate.networks.weights import save_weights
from doorstate.training.adaptation.frames import FRAME_COLUMN, SiteFrames, frame_names, prepare_frames
from doorstate.training.adaptation.held_out import check_labels, hold_out
from doorstate.training.adaptation.recipe import adaptation_recipe
from doorstate.training.adaptation.simulated import Simulated
from doorstate.training.adaptation.weights import calibrate, keep_knowledge, states_of
from doorstate.training.config import RunConfig
from doorstate.training.recipes import Recipe
from doorstate.training.run import create_fabric, train_run
from doorstate.training.run_folder import RunFolder
from doorstate.types import DOOR, NO_DOOR, STATES


@dataclass(frozen=True)
class AdaptedWeights:
    """Weights file that was written, and how it was made."""

    card: WeightsCard
    simulated_f1_before: float
    simulated_f1_after: float
    share: float  # of the way from the first weights to the trained ones


class Adaptation:
    """Adaptation of weights to labelled frames; its steps are called in the order of the methods.

    Args:
        frames: labelled frames; those whose label the weights cannot learn are left out.
        weights: weights file to start from.
        folder: folder for the files of this and other adaptations.
        seed: seed of the training.
        changes: fields of the recipe to change.

    Raises:
        DatasetError: too few frames, or a state is missing.
        WeightsError: the weights cannot be read.
    """

    def __init__(
        self,
        frames: Sequence[LabelledFrame],
        weights: Path,
        folder: Path,
        seed: int = 0,
        changes: dict[str, Any] | None = None,
    ) -> None:
        self.card = read_card(weights)
        check_card(self.card, weights)
        labels = (*STATES, NO_DOOR) if DOOR in self.card.heads else STATES
        self.frames = [frame for frame in frames if frame.label in labels]
        check_labels(frame.label for frame in self.frames)
        self.weights, self.seed, self._changes = weights, seed, changes or {}
        columns = [{**frame.columns, "state": frame.label} for frame in self.frames]
        self._is_held_out = hold_out(columns)
        begun_with = [
            [frame.name, file_digest(frame.folder / frame.file), dict(line)]
            for frame, line in zip(self.frames, columns, strict=True)
        ]
        text = json.dumps([begun_with, file_digest(weights), seed, self.recipe.model_dump(mode="json")])
        self.folder = folder / hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def held_out(self) -> list[LabelledFrame]:
        """Frames that are not trained on."""
        return [frame for frame, is_out in zip(self.frames, self._is_held_out, strict=True) if is_out]

    @cached_property
    def recipe(self) -> Recipe:
        """Recipe of the training."""
        recipe = adaptation_recipe(self.card, self._is_held_out.count(False))
        return Recipe.model_validate(recipe.model_dump() | self._changes)

    @property
    def run(self) -> RunFolder:
        """Folder of the training."""
        return RunFolder(self.folder / "run")

    def prepare(self, workers: WorkersOrEngine = None, progress: Progress = no_progress) -> SiteFrames:
        """Prepare the clouds of all frames.

        Raises:
            DatasetError: too few clouds can be used for training, or none of a state.
        """
        site = prepare_frames(self.frames, self.weights, self.folder / "clouds", workers, progress)
        rows = {row["sample_id"]: row for row in site.dataset.rows}
        trained = [rows[sample]["state"] for sample in self._samples(site.dataset, held_out=False)]
        check_labels(trained, "frames to train on in which a doorway was found")
        return site

    def train(self, site: PreparedDataset, simulated: Simulated, device: str = "auto") -> None:
        """Train on the frames that are not held out, mixed with simulated clouds."""
        roles: dict[str, Role] = dict.fromkeys(self._samples(site, held_out=False), "train")
        config = RunConfig(
            network=self.card.network,
            network_options=self.card.network_options,
            dataset=str(site.folder),
            protocol="all",
            fold=0,
            num_points=self.card.points_in_use,
            seed=self.seed,
            recipe=self.recipe,
            start_from=str(self.weights),
            heads=self.card.heads,
            extra_train_datasets=tuple(str(extra.folder) for extra in simulated.train),
        )
        train_run(config, site, roles, self.run.path, simulated.train, device)

    def finish(
        self, site: PreparedDataset, simulated: Simulated, out: Path, device: str = "auto"
    ) -> AdaptedWeights:
        """Write the adapted weights with their card.

        Raises:
            RunError: what the weights knew of simulated doors is lost.
        """
        fabric = create_fabric(self.recipe, resolve_device(device))
        adapted = keep_knowledge(self.weights, self.run.weights, fabric, simulated.test)
        held_out = self._samples(site, held_out=True)
        states = (
            states_of(adapted.network, self.card, fabric, [site], held_out) if len(held_out) > 1 else None
        )
        temperature, abstain_below = calibrate(adapted.simulated, states)
        card = self.card.model_copy(
            update={
                "temperature": temperature,
                "abstain_below": abstain_below,
                "guarantee": None,
                "trained_on": f"{self.card.trained_on}; adapted to {self._is_held_out.count(False)} labelled frames",
            }
        )
        save_weights(out, adapted.network, card, half=True)
        return AdaptedWeights(card, adapted.simulated_f1_before, adapted.simulated.macro_f1, adapted.share)

    def _samples(self, site: PreparedDataset, *, held_out: bool) -> list[str]:
        """Return the samples of the frames that are held out, or of the others."""
        names = frame_names(self.frames)
        chosen = {name for name, is_out in zip(names, self._is_held_out, strict=True) if is_out == held_out}
        return [row["sample_id"] for row in site.rows if row[FRAME_COLUMN] in chosen]
