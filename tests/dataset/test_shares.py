# SPDX-License-Identifier: Apache-2.0
import pytest

from doorstate.dataset.shares import samples_of_share
from doorstate.dataset.splits import origin
from doorstate.dataset.store import PreparedDataset


def test_a_share_has_whole_scenes_and_those_of_smaller_shares(scene_dataset: PreparedDataset) -> None:
    scenes = [origin(row) for row in scene_dataset.rows]
    names = scene_dataset.sample_ids
    before: list[str] = []
    for share in (0.1, 0.3, 0.5, 0.8, 1.0):
        kept = samples_of_share(scene_dataset, names, share)
        assert set(before) <= set(kept)
        of_kept = {scenes[names.index(name)] for name in kept}
        assert kept == [name for name, scene in zip(names, scenes, strict=True) if scene in of_kept]
        assert len(of_kept) / len(set(scenes)) == pytest.approx(share, abs=0.25)
        before = kept
    assert before == names


def test_a_share_of_selected_samples_keeps_their_order(scene_dataset: PreparedDataset) -> None:
    names = scene_dataset.sample_ids[::-2]
    kept = samples_of_share(scene_dataset, names, 0.6)
    assert 0 < len(kept) < len(names)
    assert kept == [name for name in names if name in samples_of_share(scene_dataset, names[::-1], 0.6)]
