# SPDX-License-Identifier: Apache-2.0
"""What the README shows is run: its commands on smaller data, its Python as it stands."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from sklearn.metrics import f1_score

from doorstate.evaluation.predictions import load_results
from doorstate.types import STATES

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
# What makes a command of the README small enough for a test.
SMALLER = {
    "simulate": ["--poses", "12", "--workers", "1"],
    "prepare": ["--points", "128", "--workers", "1"],
    "compare": [*shlex.split("--folds 1 --points 128 --epochs 1 --set batch_size=8 --set precision=fp32")],
}


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def commands() -> list[str]:
    return [
        line for block in blocks("bash") for line in block.splitlines() if line and not line.startswith("#")
    ]


def test_links_and_pictures_exist() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", README) + re.findall(r'src="([^"]+)"', README)
    assert targets
    assert [target for target in targets if "://" not in target and not (ROOT / target).exists()] == []


def test_make_targets_exist() -> None:
    wanted = {command.split()[1] for command in commands() if command.startswith("make ")}
    assert {"demo", "test"} <= wanted
    targets = set(
        re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    )
    assert wanted <= targets


def _summary(experiment: str) -> dict[str, dict[str, str]]:
    """Return macro F1, errors and samples of every method, of the published predictions."""
    results = load_results(ROOT / "results" / experiment)
    summary = {}
    for method in results.methods:
        tested = results.tested_by(method)
        macro_f1 = f1_score(tested["state"], tested["predicted"], labels=list(STATES), average="macro")
        errors = len(tested) - int(tested["correct"].sum())
        summary[method] = {"macro F1": f"{macro_f1:.4f}", "errors": str(errors), "samples": str(len(tested))}
    return summary


def test_the_results_are_the_published_ones() -> None:
    shown = {
        name.lower().replace("++", "2"): (f1, errors, never_seen, ms)
        for name, f1, errors, never_seen, ms in re.findall(
            r"^\| (\S+) \| ([\d.]+) \| (\d+) \| ([\d.]+) \| (\d+) \|$", README, flags=re.MULTILINE
        )
    }
    rows, by_pose = (_summary(experiment) for experiment in ("paper", "by-pose"))
    published = {
        name: (row["macro F1"], row["errors"], by_pose[name]["macro F1"]) for name, row in rows.items()
    }
    assert {name: figures[:3] for name, figures in shown.items()} == published
    (rule,) = re.findall(r"`wall_leaf_angle`, has (\d+) errors", README)
    assert rule == _summary("related")["wall_leaf_angle"]["errors"]
    (samples,) = {row["samples"] for row in rows.values()}
    assert f"| errors of {samples} |" in README
    latency = (ROOT / "docs/benchmarks/latency.md").read_text(encoding="utf-8")
    for name, (*_, ms) in shown.items():
        (total,) = re.findall(
            rf"^\| {name} \| torch \| 4096 \| 2 \|.* ([\d.]+) \([\d.]+\) \|$", latency, flags=re.MULTILINE
        )
        assert abs(float(total) - int(ms)) <= 0.5, name


@pytest.mark.slow
def test_the_commands_run_in_the_order_shown(simulated_folder: Path, tmp_path: Path) -> None:
    shutil.copy(sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0], tmp_path / "cloud.pcd")
    shutil.copytree(ROOT / "paper" / "experiments", tmp_path / "paper" / "experiments")
    doorstate = Path(sys.executable).with_name("doorstate")
    ran = []
    for command in commands():
        if command.startswith(("make ", "pip ")):
            continue
        program, name, *arguments = shlex.split(command)
        assert program == "doorstate", command
        full = [doorstate, name, *arguments, *SMALLER.get(name, [])]
        finished = subprocess.run(full, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert finished.returncode == 0, f"{command}: {finished.stderr}"
        ran.append(name)
    assert {"simulate", "prepare", "compare", "report", "predict"} <= set(ran)


def test_the_python_runs(simulated_folder: Path, tmp_path: Path) -> None:
    shutil.copy(sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0], tmp_path / "cloud.pcd")
    for block in blocks("python"):
        subprocess.run([sys.executable, "-c", block], cwd=tmp_path, check=True, capture_output=True)


@pytest.mark.slow
def test_pip_install_brings_weights_templates_and_the_typed_marker(tmp_path: Path) -> None:
    assert "pip install ." in commands()
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
    subprocess.run([*pip, "--target", tmp_path / "site", "."], cwd=ROOT, check=True, capture_output=True)
    package = tmp_path / "site" / "doorstate"
    for name in (
        "py.typed",
        "evaluation/templates/report.html.j2",
        "viewer/templates/view.html.j2",
        "networks/pretrained/pointnet2.safetensors",
    ):
        assert (package / name).is_file(), name
