# SPDX-License-Identifier: Apache-2.0
"""Source and settings of a prepared data set."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from doorstate._files import is_vacant, read_csv, write_text
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.class_folders import labelled_rows
from doorstate.dataset.crops import Crops
from doorstate.dataset.layouts import find_layout
from doorstate.dataset.strata import distance_band, region
from doorstate.errors import ConfigError, DatasetError
from doorstate.io.options import ReadOptions
from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
from doorstate.simulation.writer import is_simulated, read_settings

CLAIM = "preparation.json"


class Preparation(NamedTuple):
    """Source of the clouds, and how they are read and prepared."""

    source: Path  # a simulated folder, class folders of clouds, or the folder of a `layout`
    spec: CloudSpec = CloudSpec()
    poses_csv: Path | None = None  # distances and angles for class folders (`dataset.class_folders`)
    options: ReadOptions = ReadOptions()  # for files that do not state their camera and units
    layout: str | None = None  # of a published data set (`dataset.layouts`)
    crops: Crops | None = None  # of doorways; None for whole clouds

    @property
    def is_simulated(self) -> bool:
        """True if the source was written by the simulator."""
        return self.layout is None and is_simulated(self.source)

    @property
    def source_name(self) -> str:
        """Preset of a simulated source, else the folder's name."""
        return read_settings(self.source).preset.name if self.is_simulated else self.source.resolve().name

    def rows(self) -> list[dict[str, str]]:
        """Return one row for each sample of the source, in order.

        Raises:
            ConfigError: options that a simulated source does not take, or crops that need the poses of doors.
            DatasetError: the source holds no samples.
        """
        if self.crops is not None and self.crops != Crops(kept="best") and not self.is_simulated:
            raise ConfigError(
                "holds no poses of doors: only the best crop of each cloud has a label",
                path=self.source,
                field="crops",
                expected="best",
            )
        if self.layout is not None:
            return find_layout(self.layout).rows(self.source)
        if not self.is_simulated:
            return labelled_rows(self.source, self.poses_csv)
        if self.poses_csv is not None or self.options != ReadOptions():
            raise ConfigError(
                "is simulated and has its own poses and camera",
                path=self.source,
                hint="leave out the options of poses and cameras",
            )
        return _simulated_rows(self.source)

    def to_json(self, rows: Sequence[dict[str, str]]) -> str:
        """Return the text that identifies this preparation of these rows."""
        settings = {
            "source": str(self.source.resolve()),
            "spec": self.spec.model_dump(),
            "options": repr(self.options),
            "layout": self.layout,
            **({} if self.crops is None else {"crops": self.crops.model_dump()}),
            "rows": hashlib.sha256(json.dumps(rows).encode()).hexdigest(),
        }
        return json.dumps(settings, indent=2) + "\n"

    def claim(self, folder: Path, rows: Sequence[dict[str, str]]) -> None:
        """Mark a folder as the target of this preparation.

        Raises:
            ConfigError: the folder holds something else.
        """
        path, text = folder / CLAIM, self.to_json(rows)
        if is_vacant(folder):
            write_text(path, text)
        elif not path.is_file():
            raise ConfigError("exists and holds something else", path=folder, hint="choose another folder")
        # Also after writing: another shard may have claimed the folder at the same moment.
        if path.read_text(encoding="utf-8") != text:
            raise ConfigError(
                "holds a preparation of something else", path=folder, hint="choose another folder"
            )


def _simulated_rows(source: Path) -> list[dict[str, str]]:
    if not (source / MANIFEST_FILE).exists():
        raise DatasetError("the simulation is not complete", path=source, hint="continue it first")
    rows = []
    for row in read_csv(source / MANIFEST_FILE):
        sample = unflatten(row)
        rows.append(
            row
            | {"distance_band": distance_band(sample.distance_m), "region": region(sample.robot_angle_deg)}
        )
    return rows
