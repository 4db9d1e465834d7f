# SPDX-License-Identifier: Apache-2.0
"""Results on disk: a JSON file from which a killed benchmark continues, and a Markdown table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from doorstate._files import write_text
from doorstate.errors import ConfigError, RunError
from doorstate.evaluation.table import Table

Result = dict[str, Any]
"""One result, in the form in which it is stored."""


class Store:
    """Results of one benchmark by key, with the settings they were measured with.

    Raises:
        ConfigError: the folder holds results of other settings.
        RunError: the file cannot be read.
    """

    def __init__(self, folder: Path, name: str, settings: dict[str, Any], fresh: bool) -> None:
        self._json, self._markdown = folder / f"{name}.json", folder / f"{name}.md"
        self._settings = settings
        self.results: dict[str, Result] = {}
        if fresh or not self._json.is_file():
            return
        hint = "use --fresh or another --out"
        try:
            content = json.loads(self._json.read_text(encoding="utf-8"))
            stored_settings, self.results = content["settings"], content["results"]
        except (ValueError, KeyError, TypeError) as error:
            raise RunError(f"cannot be read ({error})", path=self._json, hint=hint) from error
        for key, value in settings.items():
            if stored_settings.get(key) != value:
                raise ConfigError(
                    f"measured with {key} {stored_settings.get(key)}, not {value}", path=self._json, hint=hint
                )

    def save(self, table: Table) -> None:
        """Write the results and their table."""
        content = {"settings": self._settings, "results": self.results}
        write_text(self._json, json.dumps(content, indent=1) + "\n")
        settings = ", ".join(f"{key} {value}" for key, value in self._settings.items() if value != "")
        write_text(self._markdown, f"{table.to_markdown()}\nMade with {settings}.\n")


def save_rows(folder: Path, name: str, settings: dict[str, Any], rows: list[Result], table: Table) -> None:
    """Write the rows of a benchmark that is measured as a whole."""
    store = Store(folder, name, settings, fresh=True)
    store.results = {"all": {"rows": rows}}
    store.save(table)
