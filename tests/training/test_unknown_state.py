# SPDX-License-Identifier: Apache-2.0
"""Doors of unknown state in training: doors for the head `door`, without a state, an angle and a hinge."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from doorstate.clouds.augmentation import Augmentation
from doorstate.dataset.loader import CloudLoader
from doorstate.dataset.roles import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, DatasetError
from doorstate.networks import create_network
from doorstate.networks.head_layers import add_heads, joint_losses
from doorstate.networks.heads import IGNORE_INDEX
from doorstate.training.network_outputs import network_outputs
from doorstate.training.recipes import Recipe
from doorstate.training.rule_run import RuleRunConfig, run_rule
from doorstate.training.run import create_fabric

HEADS = ("door", "angle", "hinge", "frame", "widths")
Relabel = Callable[[int], PreparedDataset]


@pytest.fixture
def relabel(scene_dataset: PreparedDataset) -> Relabel:
    """Return `scene_dataset` with the first doors of unknown state."""

    def relabel(count: int) -> PreparedDataset:
        rows = [dict(row) for row in scene_dataset.rows]
        for row in [row for row in rows if row["state"] != "no_door"][:count]:
            row |= {"state": "unknown", "hinge": "", "opening_angle_deg": ""}
        return PreparedDataset(
            scene_dataset.folder,
            scene_dataset.description,
            rows,
            scene_dataset.clouds,
            np.asarray(scene_dataset.parts_of(np.arange(len(rows)), scene_dataset.num_points)),
        )

    return relabel


def test_their_number_is_four_and_they_have_no_class(relabel: Relabel) -> None:
    dataset = relabel(3)
    assert (dataset.labels == 4).sum() == 3
    loader = CloudLoader(dataset, dataset.sample_ids, 64, heads=HEADS)
    (batch,) = loader.in_order(len(loader))
    unknown, empty = torch.tensor(dataset.labels == 4), torch.tensor(dataset.labels == 3)
    assert torch.equal(batch.labels == IGNORE_INDEX, unknown | empty)
    assert (batch.targets["door"][unknown] == 1).all()
    assert (batch.targets["door"][empty] == 0).all()
    for name in ("angle", "hinge"):
        assert batch.targets[name][unknown].isnan().all()
    for name in ("frame", "widths"):
        assert not batch.targets[name][unknown].isnan().any()


def test_they_count_as_doors_where_the_share_of_empty_scenes_is_fixed(relabel: Relabel) -> None:
    dataset = relabel(6)
    loader = CloudLoader(dataset, dataset.sample_ids, 64, heads=HEADS)
    batches = loader.shuffled(4, Augmentation(), [1], limit=20, no_door_share=0.25)
    doors = torch.cat([batch.targets["door"] for batch in batches])
    assert (doors == 0).sum() == 5


def test_a_batch_of_them_trains_the_door_and_not_the_state(relabel: Relabel) -> None:
    dataset = relabel(4)
    unknown = [row["sample_id"] for row in dataset.rows if row["state"] == "unknown"]
    (batch,) = CloudLoader(dataset, unknown, 128, heads=HEADS).in_order(4)
    network = create_network("pointnet")
    add_heads(network, HEADS)
    losses, _ = joint_losses(network, batch.points, batch.labels, batch.targets)
    values = {name: float(loss.detach()) for name, loss in losses.items()}
    assert values["state"] == values["angle"] == values["hinge"] == 0
    assert min(values[name] for name in ("door", "frame", "widths")) > 0


def test_they_need_the_head_for_doors(relabel: Relabel) -> None:
    dataset = relabel(2)
    doors = [row["sample_id"] for row in dataset.rows if row["state"] != "no_door"]
    with pytest.raises(ConfigError, match="2 samples"):
        CloudLoader(dataset, doors, 64, heads=("angle",))


def test_scores_of_states_leave_them_out(relabel: Relabel) -> None:
    dataset = relabel(5)
    network = create_network("pointnet")
    add_heads(network, ("door",))
    loader = CloudLoader(dataset, dataset.sample_ids, 128, heads=("door",))
    outputs = network_outputs(network, loader, create_fabric(Recipe(name="common"), torch.device("cpu")))
    assert outputs.has_state.tolist() == (dataset.labels < 3).tolist()
    assert len(outputs.head_values["door"]) == len(dataset)
    right = outputs.probabilities.argmax(1)[dataset.labels < 3] == dataset.labels[dataset.labels < 3]
    assert outputs.accuracy == right.mean()


def test_rules_are_not_asked_for_their_state(relabel: Relabel, tmp_path: Path) -> None:
    dataset = relabel(2)
    roles: dict[str, Role] = {}
    for row in dataset.rows:
        roles[row["sample_id"]] = "test" if row["state"] == "unknown" else "train"
    config = RuleRunConfig(rule="plane-state", parameters={}, dataset="", protocol="paper", fold=0)
    with pytest.raises(DatasetError, match="no test sample"):
        run_rule(config, dataset, roles, tmp_path)
