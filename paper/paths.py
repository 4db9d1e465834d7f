# SPDX-License-Identifier: Apache-2.0
"""Folders of the repository, and titles of methods as pages print them."""

from __future__ import annotations

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
EXPERIMENTS = REPOSITORY / "paper" / "experiments"
RESULTS = REPOSITORY / "results"
RUNS = REPOSITORY / "runs"
BUILD = REPOSITORY / "build"
DOCS = REPOSITORY / "docs"
PRETRAINED = REPOSITORY / "src" / "doorstate" / "networks" / "pretrained"

TITLES = {
    "pointnet": "PointNet",
    "pointnet2": "PointNet++",
    "dgcnn": "DGCNN",
    "pointcnn": "PointCNN",
    "point2sequence": "Point2Sequence",
    "mvcnn": "MVCNN",
}
