# SPDX-License-Identifier: Apache-2.0
"""Render the report of a published experiment: tables, figures and a page."""

from __future__ import annotations

from pathlib import Path

from doorstate.evaluation.report import write_results_report
from doorstate.evaluation.resolution import write_resolution
from doorstate.evaluation.transfer import score_transfer, write_transfer

from . import paths
from .definition import read_definition
from .published import side_by_side, study


def write_published_report(name: str, out: Path | None = None) -> Path:
    """Write the report of `results/NAME`; a study has tables and figures only.

    Args:
        name: published experiment.
        out: folder, made if absent; `build/NAME` if not given.

    Returns:
        Page of the report, or the folder of a study.
    """
    definition, folder = read_definition(name), out or paths.BUILD / name
    if definition.command == "resolution":
        return write_resolution(study(name), folder)
    if definition.command == "transfer":
        trained, tested = (list(definition.content[key]) for key in ("trained", "tested"))
        return write_transfer(score_transfer(study(name), trained, tested), folder)
    return write_results_report(side_by_side(name), folder)
