# SPDX-License-Identifier: Apache-2.0
"""What docs/tutorial.md and docs/inputs.md show is run as it stands, and prints what they say."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

from doorstate.io.pcd import write_pcd
from doorstate.io.readers import read_cloud
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset

ROOT = Path(__file__).resolve().parents[1]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
INPUTS = (ROOT / "docs" / "inputs.md").read_text(encoding="utf-8")
Run = Callable[..., tuple[int, str, str]]


def comparable(output: str) -> list[list[str]]:
    """Cells of every row but the last of a table's, which is milliseconds, and words of other lines."""
    lines = [line for line in output.splitlines() if line.strip(" ┏┓┳━┡╇┩└┴┘─")]
    return [line.split("│")[:-2] if "│" in line else line.rstrip(" ms┃").split() for line in lines]


@pytest.mark.slow
def test_the_tutorial_runs_and_prints_what_it_shows(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    programs = {"python": sys.executable, "doorstate": str(Path(sys.executable).with_name("doorstate"))}
    steps = re.findall(r"```bash\n(.*?)\n```(?:\n\n```text\n(.*?)```)?", TUTORIAL, flags=re.DOTALL)
    assert len(steps) == 6
    assert steps.pop(0)[0] == 'pip install ".[bags]"'
    for command, shown in steps:
        program, *arguments = shlex.split(command)
        finished = subprocess.run(
            [programs[program], *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert finished.returncode == 0, f"{command}: {finished.stderr}"
        if shown:
            assert comparable(finished.stdout) == comparable(shown), command
    assert len((tmp_path / "door.csv").read_text().splitlines()) == 41
    assert (tmp_path / "door.html").is_file()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One open door in every form that the page names."""
    folder = tmp_path_factory.mktemp("inputs")
    preset = PRESETS["ogurob"]
    settings = SimulationSettings(preset=preset, seed=3, poses=1, raw=("pcd", "depth"))
    simulate_dataset(folder / "simulated", settings, workers=1)
    (source,) = (folder / "simulated" / "pcd" / "open").glob("*.pcd")
    cloud = read_cloud(source)[::2, ::2]
    flat = cloud.reshape(-1, 3)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(flat)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    (folder / "recordings").mkdir()
    for path in (folder / "cloud.pcd", folder / "recordings" / "1.pcd"):
        write_pcd(path, cloud)
    (folder / "scan.ply").write_bytes(header.encode() + flat.astype("<f4").tobytes())
    np.save(folder / "cloud.npy", cloud)
    np.save(folder / "optical.npy", np.stack((-cloud[..., 2], cloud[..., 1], cloud[..., 0]), -1) * 1000)
    np.savetxt(folder / "cloud.csv", flat, delimiter=",", header="x,y,z", comments="")
    (picture,) = (folder / "simulated" / "depth" / "open").glob("*.png")
    picture.rename(folder / "depth.png")
    (folder / "camera_info.yaml").write_text(json.dumps(vars(preset.camera.intrinsics())))
    return folder


def test_every_kind_of_input_is_answered(run: Run, files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(files)
    shown = re.findall(r"`doorstate (predict [^`]+)`", INPUTS) + re.findall(
        r"^doorstate (predict .+)$", INPUTS, flags=re.MULTILINE
    )
    commands = [command for command in shown if "--bag" not in command]
    assert len(commands) == 10
    for command in commands:
        code, out, err = run(*shlex.split(command), "--rule", "plane_state", "--json")
        assert code == 0, f"{command}: {err}"
        turned = "--frame" in command  # the file is no optical cloud: what is asked there is nonsense
        assert turned or json.loads(out)["state"] == "open", command


def test_arrays_are_turned_as_shown(
    files: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(files)
    of_files, of_arrays = re.findall(r"```python\n(.*?)```", INPUTS, flags=re.DOTALL)
    exec(compile(of_arrays, "docs/inputs.md", "exec"), {})
    assert "state=<DoorState.OPEN: 2>" in capsys.readouterr().out
    exec(compile(of_files, "docs/inputs.md", "exec"), {})
    assert "Prediction(state=" in capsys.readouterr().out
