# SPDX-License-Identifier: Apache-2.0
"""The pages of results as they will be when every experiment is published."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import load_results
from tests.evaluation.conftest import MakeComparison

NETWORKS = ("pointnet", "pointnet2", "dgcnn", "pointcnn", "point2sequence")
TABLES = (
    "table1_samples summary table2_confusion table3_scores table4_closed table5_semi_open table6_open "
    "paired_tests error_kinds calibration reasons angle_errors"
)


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    from paper.pages import results

    return results


@pytest.fixture
def publish(simulated: PreparedDataset, make_comparison: MakeComparison, tmp_path: Path) -> MakeComparison:
    """A published experiment whose tables hold their names; answers are right but for those in `wrong`."""

    def make(name: str, **options: object) -> Path:
        folder = tmp_path / "results" / name
        folder.parent.mkdir(parents=True, exist_ok=True)
        make_comparison(simulated, name=folder.name, **options).rename(folder)  # type: ignore[arg-type]
        for table in TABLES.split():
            path = folder / "report" / "tables" / f"{table}.md"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"({folder.name}: {table})\n")
        return folder

    return make


def write(pages: ModuleType, simulated: PreparedDataset, tmp_path: Path) -> tuple[str, str]:
    results, related = tmp_path / "results.md", tmp_path / "related.md"
    root = tmp_path / "results"
    (root / simulated.folder.name).symlink_to(simulated.folder)
    pages.write_pages(root, root, results, related)
    return results.read_text(), related.read_text() if related.exists() else ""


def test_every_experiment_has_its_section(
    pages: ModuleType, publish: MakeComparison, simulated: PreparedDataset, tmp_path: Path
) -> None:
    samples = [row["sample_id"] for row in simulated.rows]
    wrong = {"pointnet": {samples[5]: "closed", samples[8]: "closed"}}
    publish("paper", networks=NETWORKS, wrong=wrong)
    publish("by-pose", networks=NETWORKS, wrong={"dgcnn": {samples[5]: "closed"}})
    publish("authors", networks=NETWORKS)
    publish("related", networks=("mvcnn",))
    publish("resolution/as-trained-128", networks=NETWORKS)
    text, related = write(pages, simulated, tmp_path)
    assert "still being trained" not in text
    assert "Every network should reach 0.995: pointnet does not" in text
    assert "| PointNet has the lowest recall on open doors | pointnet, 95.00 % | yes |" in text
    everybody = " and ".join(NETWORKS)
    assert f"| PointNet has the lowest recall on semi-open doors | {everybody}, 100.00 % | no |" in text
    assert "| PointNet++ recognises every open door | 40 of 40 | yes |" in text
    assert "Of the 2 errors of all networks" in text
    assert "| dgcnn | 1.0000 | 0.99" in text, "the gap between protocols"
    assert "| between learned directions, " in text
    assert "| pointnet | 0 | 3 of 250 |" in text, "epochs of the authors' recipe"
    for name in ("paper", "by-pose", "authors"):
        assert f"({name}: summary)" in text
    for part in ("## Poses never seen", "## The authors' own recipes", "## How many points", "| all |"):
        assert part in text
    assert "(related: angle_errors)" in related
    assert "on the same 120 test samples (5 of 5 folds)" in related


def test_what_is_missing_is_said(
    pages: ModuleType, publish: MakeComparison, simulated: PreparedDataset, tmp_path: Path
) -> None:
    publish("paper", networks=NETWORKS, missing=[("dgcnn", 3), ("dgcnn", 4)])
    publish("by-pose", networks=NETWORKS, missing=[("pointnet", 0)])
    text, related = write(pages, simulated, tmp_path)
    assert (
        "**`paper` is still being trained:** 2 runs are missing.\nThe numbers below cover the 3 of 5" in text
    )
    assert "**`by-pose` is still being trained:** 1 run is missing.\nIts tables come" in text
    assert "## Poses never seen" not in text
    assert related == ""


def test_errors_are_told_by_what_they_have_in_common(
    pages: ModuleType, make_comparison: MakeComparison, simulated: PreparedDataset
) -> None:
    rows = {row["sample_id"]: row for row in simulated.rows}

    def first(state: str, near: bool, nearby: bool) -> str:
        return next(
            name
            for name, row in rows.items()
            if row["state"] == state
            and (min(abs(float(row["opening_angle_deg"]) - border) for border in (15, 65, 75)) <= 5) is near
            and (float(row["distance_m"]) < 2) is nearby
        )

    wrong = {
        "pointnet": {first("open", True, False): "semi_open", first("open", False, True): "semi_open"},
        "dgcnn": {first("semi_open", False, False): "open"},
    }
    results = load_results(make_comparison(simulated, wrong))
    published = pages.Published(results, rows, {}, {}, {})
    assert published.kinds_of_errors() == (3, 1, 1)


def test_a_place_is_beyond_what_was_learned_or_between(
    pages: ModuleType, make_comparison: MakeComparison, simulated: PreparedDataset
) -> None:
    from paper.pages import places as extrapolation

    results = load_results(make_comparison(simulated, protocol="by-pose"))
    at = {"close left": (20, 1.6), "left": (40, 1.6), "far right": (150, 3.0), "middle": (90, 2.0)}
    roles = {"close left": "train", "left": "test", "far right": "train", "middle": "train"}
    rows = {
        name: {"sample_id": name, "robot_angle_deg": str(bearing), "distance_m": str(distance)}
        for name, (bearing, distance) in at.items()
    }

    def cases_of_left() -> list[str]:
        found = extrapolation.places_cases(replace(results, splits=(roles,)), rows)
        return [case for case, belongs in found.items() if belongs(rows["left"])]

    assert cases_of_left() == ["beyond them, nearer than 2.5 m"]
    rows["middle"]["distance_m"] = "1.8"
    assert cases_of_left() == ["between learned directions, nearer than 2.5 m"]
