# SPDX-License-Identifier: Apache-2.0
"""Results on disk: one JSON file that a killed run is continued from, and the Markdown made of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from doorstate._files import write_text
from doorstate.errors import ConfigError, RunError
from doorstate.evaluation.table import Table

Group = dict[str, Any]


class Store:
    """Finished groups of one benchmark by key, kept with the settings they were measured with.

    Raises:
        ConfigError: the folder holds results of other settings.
        RunError: its file cannot be read.
    """

    def __init__(self, folder: Path, name: str, settings: dict[str, Any], fresh: bool) -> None:
        self._json, self._markdown = folder / f"{name}.json", folder / f"{name}.md"
        self._settings = settings
        self.groups: dict[str, Group] = {}
        if fresh or not self._json.is_file():
            return
        try:
            stored = json.loads(self._json.read_text(encoding="utf-8"))
            then, self.groups = stored["settings"], stored["groups"]
        except (ValueError, KeyError, TypeError) as error:
            raise RunError(
                f"{self._json}: cannot be read ({error}); give --fresh or another --out"
            ) from error
        for key, value in settings.items():
            if then.get(key) != value:
                raise ConfigError(
                    f"{self._json}: made with {key} {then.get(key)}, not {value}; give --fresh or another --out"
                )

    def save(self, table: Table) -> None:
        """Write groups and table, each in one step."""
        content = {"settings": self._settings, "groups": self.groups}
        write_text(self._json, json.dumps(content, indent=1) + "\n")
        made_with = ", ".join(f"{key} {value}" for key, value in self._settings.items() if value != "")
        write_text(self._markdown, f"{table.to_markdown()}\nMade with {made_with}.\n")


def write_once(folder: Path, name: str, settings: dict[str, Any], rows: list[Group], table: Table) -> None:
    """Store results that are measured in one go."""
    store = Store(folder, name, settings, fresh=True)
    store.groups = {"all": {"rows": rows}}
    store.save(table)
