# SPDX-License-Identifier: Apache-2.0
"""Output of the commands of docs/tutorial.md, compared with the output that the page shows."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rosbags")


ROOT = Path(__file__).resolve().parents[1]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")


def comparable(output: str) -> list[list[str]]:
    """Return the cells of table rows without the last one (milliseconds), and the words of other lines."""
    lines = [line for line in output.splitlines() if line.strip(" ┏┓┳━┡╇┩└┴┘─")]
    return [line.split("│")[:-2] if "│" in line else line.rstrip(" ms┃").split() for line in lines]


@pytest.mark.slow
def test_commands_print_the_output_of_the_page(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    programs = {"python": sys.executable, "doorstate": str(Path(sys.executable).with_name("doorstate"))}
    steps = re.findall(r"```bash\n(.*?)\n```(?:\n\n```text\n(.*?)```)?", TUTORIAL, flags=re.DOTALL)
    assert len(steps) == 6
    assert steps.pop(0)[0] == 'pip install ".[bags]"'
    for command, output in steps:
        program, *arguments = shlex.split(command)
        finished = subprocess.run(
            [programs[program], *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert finished.returncode == 0, f"{command}: {finished.stderr}"
        if output:
            assert comparable(finished.stdout) == comparable(output), command
    assert len((tmp_path / "door.csv").read_text().splitlines()) == 41
    assert (tmp_path / "door.html").is_file()
