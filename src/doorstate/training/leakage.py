# SPDX-License-Identifier: Apache-2.0
"""Checks that nothing tested in a comparison was trained on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from doorstate.dataset.join import check_same_sampling
from doorstate.dataset.loader import CloudLoader, check_states
from doorstate.dataset.roles import Role
from doorstate.dataset.splits import origin, read_splits
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.errors import ConfigError, RunError
from doorstate.training.experiment import Experiment


def check_extra_datasets(experiment: Experiment, dataset: PreparedDataset) -> None:
    """Check the data sets that are trained on in addition.

    Raises:
        ConfigError: they show scenes of the tested data set, or do not fit it.
        DatasetError: one cannot be opened.
    """
    if not experiment.extra_train_datasets:
        return
    heads = {head for network in experiment.networks for head in experiment.heads_of(network)}
    tested_scenes = {origin(row) for row in dataset.rows}
    for path in experiment.extra_train_datasets:
        extra = open_dataset(Path(path))
        check_states(extra, extra.sample_ids, experiment.heads)
        check_same_sampling(extra, dataset)
        # Loading one sample raises for missing points or targets.
        CloudLoader(extra, extra.sample_ids[:1], experiment.num_points, heads=sorted(heads))
        if shared := [row["sample_id"] for row in extra.rows if origin(row) in tested_scenes]:
            raise ConfigError(
                f"{len(shared)} samples of {path} show scenes of {experiment.dataset}, such as {shared[0]}",
                field="extra_train_datasets",
                hint="simulate it with another seed",
            )


def check_start_from(
    experiment: Experiment,
    splits: Sequence[Mapping[str, Role]],
    start_from: Path,
    start_settings: Mapping[str, Any],
) -> None:
    """Check the comparison whose weights an experiment starts from.

    Args:
        experiment: experiment to run.
        splits: roles of its samples, by fold.
        start_from: folder of the earlier comparison.
        start_settings: configuration of the earlier comparison.

    Raises:
        RunError: it has none of the networks, or trained on samples that are tested now.
    """
    if not set(experiment.networks) & set(start_settings["networks"]):
        raise RunError(
            f"has no weights of {' or '.join(experiment.networks)}", path=start_from, field="start_from"
        )
    if experiment.dataset in start_settings["extra_train_datasets"]:
        raise RunError(
            f"was trained on all of {experiment.dataset}, which is tested here",
            path=start_from,
            field="start_from",
        )
    if start_settings["dataset"] != experiment.dataset:  # names of another data set mean other samples
        return
    start_splits = read_splits(start_from / "splits.csv")
    for fold, (roles, start_roles) in enumerate(zip(splits, start_splits, strict=False)):
        for sample, role in roles.items():
            if role == "test" and start_roles.get(sample) in ("train", "val"):
                raise RunError(
                    f"fold {fold} was trained on {sample}, which is tested here",
                    path=start_from,
                    field="start_from",
                    hint="use the seed and the protocol of that comparison",
                )
