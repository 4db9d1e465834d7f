# SPDX-License-Identifier: Apache-2.0
"""CSV files of poses for class folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.dataset.class_folders import labelled_rows
from doorstate.errors import DatasetError


def touch(root: Path, *names: str) -> Path:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).touch()
    return root


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return touch(tmp_path / "doors", "open/1.pcd", "closed/1.pcd", "closed/2.pcd")


def poses(folder: Path, text: str) -> Path:
    path = folder / "poses.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "pose"),
    [("x_m,y_m", "-1.5,2.0"), ("distance_m,robot_angle_deg", "2.5,126.869897646")],
)
def test_poses_in_both_forms_give_the_same_strata(root: Path, header: str, pose: str) -> None:
    csv = poses(root.parent, f"file,{header},light\nclosed/1.pcd,{pose},dim\n")
    posed, unposed, _ = labelled_rows(root, csv)
    assert float(posed["distance_m"]) == 2.5
    assert float(posed["robot_angle_deg"]) == pytest.approx(126.8698976)
    assert (posed["distance_band"], posed["region"], posed["light"]) == ("2.5-3.0", "yellow", "dim")
    assert posed["pose_id"]
    assert "region" not in unposed


def test_a_bare_file_name_applies_to_every_state(root: Path) -> None:
    csv = poses(root.parent, "file,x_m,y_m\n1.pcd,0,2\nclosed/2.pcd,0,3\n")
    rows = {row["file"]: row for row in labelled_rows(root, csv)}
    assert rows["open/1.pcd"]["pose_id"] == rows["closed/1.pcd"]["pose_id"] == "0.000,2.000"
    assert rows["closed/2.pcd"]["distance_band"] == "3.0-3.5"


def test_a_pose_keeps_its_name_but_no_label(root: Path) -> None:
    csv = poses(root.parent, "file,pose_id,x_m,y_m,state,sample_id\n2.pcd,corner,1,1,open,x\n")
    row = next(row for row in labelled_rows(root, csv) if row["file"] == "closed/2.pcd")
    assert (row["pose_id"], row["state"], row["sample_id"]) == ("corner", "closed", "closed/2")
    assert row["distance_band"] == "outside"


@pytest.mark.parametrize(
    ("text", "line", "field"),
    [
        ("name,x_m,y_m\n1.pcd,0,2\n", "line 2", "file"),
        ("file,x_m,y_m\n1.pcd,0,2\n,0,2\n", "line 3", "file"),
        ("file,x_m,y_m\n1.pcd,0,2\n1.pcd,0,3\n", "line 3", "file"),
        ("file,x_m\n1.pcd,0\n", "line 2", None),
        ("file,x_m,y_m\n1.pcd,0,\n", "line 2", None),
        ("file,x_m,y_m\n1.pcd,0,two\n", "line 2", "y_m"),
        ("file,x_m,y_m\n1.pcd,0,nan\n", "line 2", "y_m"),
        ("file,distance_m,robot_angle_deg\n1.pcd,inf,90\n", "line 2", "distance_m"),
        ("file,x_m,y_m,opening_angle_deg\n1.pcd,0,2,?\n", "line 2", "opening_angle_deg"),
        ("file,x_m,y_m\n1.pcd,0,2\n3.pcd,0,2\n4.pcd,0,2\n", "3.pcd", "file"),
        ("file,x_m,y_m\n1.pcd,0\n", "line 2", None),
    ],
)
def test_invalid_poses_are_refused_with_line_and_column(
    root: Path, text: str, line: str, field: str | None
) -> None:
    with pytest.raises(DatasetError, match=line) as refused:
        labelled_rows(root, poses(root.parent, text))
    assert refused.value.field == field
    assert "poses.csv" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_missing_file_of_poses_is_refused(root: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere\.csv: cannot be read"):
        labelled_rows(root, root / "nowhere.csv")
