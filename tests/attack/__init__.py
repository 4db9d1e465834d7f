# SPDX-License-Identifier: Apache-2.0
"""Attacks that earlier versions did not stand, repeated: `python -m tests.attack`, and in short form by the suite."""

from __future__ import annotations

from tests.attack.full_disks import attack_disks, attack_pipes
from tests.attack.moments import attack_moments
from tests.attack.numbers import attack_graphs, attack_streams, attack_weights
from tests.attack.owners import attack_files, attack_folders, attack_shards
from tests.attack.paths import attack_names
from tests.attack.signals import attack_commands
from tests.attack.special_files import attack_inputs, attack_large
from tests.attack.swaps import attack_contents
from tests.attack.texts import attack_file_names, attack_settings
from tests.attack.tries import Attack

ATTACKS: dict[str, Attack] = {
    "weights": attack_weights,
    "graphs": attack_graphs,
    "streams": attack_streams,
    "folders": attack_folders,
    "shards": attack_shards,
    "files": attack_files,
    "contents": attack_contents,
    "names": attack_names,
    "inputs": attack_inputs,
    "large": attack_large,
    "disks": attack_disks,
    "pipes": attack_pipes,
    "signals": attack_commands,
    "moments": attack_moments,
    "settings": attack_settings,
    "file-names": attack_file_names,
}
"""Attacks by name."""
