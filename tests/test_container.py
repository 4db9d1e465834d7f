# SPDX-License-Identifier: Apache-2.0
"""The container, as far as can be checked without docker: files, locks, rights, its command and its health check."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import socket
import subprocess
import sys
import time
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
INSTRUCTIONS = [
    (word, rest.strip())
    for word, _, rest in (
        line.partition(" ")
        for line in (ROOT / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
        if line and not line.startswith(("#", " "))
    )
]
PAGE = (ROOT / "docs/container.md").read_text(encoding="utf-8")


def of(word: str) -> list[str]:
    return [rest for found, rest in INSTRUCTIONS if found == word]


def is_sent(path: str) -> bool:
    """Return True if a file goes to docker: the last rule of .dockerignore that names it or a folder of it decides."""
    sent = True
    for rule in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines():
        if rule and not rule.startswith("#"):
            pattern = rule.removeprefix("!").removeprefix("**/")
            parents = [str(parent) for parent in (Path(path), *Path(path).parents)][:-1]
            if any(fnmatch(part, pattern) for part in (*parents, *path.split("/"))):
                sent = rule.startswith("!")
    return sent


def test_what_is_copied_exists_and_is_sent() -> None:
    copied = {
        source for line in of("COPY") if not line.startswith("--from") for source in shlex.split(line)[:-1]
    }
    assert {"src", "requirements-container.lock", "pyproject.toml"} <= copied
    for source in copied:
        assert (ROOT / source).exists(), source
        assert is_sent(source), source
    assert is_sent("src/doorstate/cli/serve.py")


@pytest.mark.parametrize(
    "path",
    [
        ".git/config",
        "secrets.env",
        "data/x.npy",
        ".venv/bin/python",
        "tools/lock.py",
        "src/a/__pycache__/a.pyc",
    ],
)
def test_nothing_else_is_sent(path: str) -> None:
    assert not is_sent(path)


def test_what_the_build_of_the_wheel_reads_is_copied() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    copied = " ".join(of("COPY")).split()
    assert {project["readme"], *project["license-files"]} <= set(copied)


def test_packages_are_installed_by_their_sums() -> None:
    installs = re.findall(r"pip install [^&]*", " ".join(of("RUN")))
    assert len(installs) == 3
    assert all("--require-hashes" in line or "--no-deps" in line for line in installs)
    assert "setuptools==" in (ROOT / "tools/release.lock").read_text(encoding="utf-8")


def test_it_runs_without_rights_and_holds_no_secret() -> None:
    stages = [index for index, (word, _) in enumerate(INSTRUCTIONS) if word == "FROM"]
    last = INSTRUCTIONS[stages[-1] :]
    (user,) = [rest for word, rest in last if word == "USER"]
    assert re.fullmatch(r"[1-9]\d{3,}:[1-9]\d{3,}", user)
    order = [word for word, _ in last]
    assert order.index("USER") < order.index("ENTRYPOINT")
    assert "apt-get" not in str(last)
    assert not re.search(r"TOKEN|PASSWORD|SECRET", str(INSTRUCTIONS), flags=re.IGNORECASE)
    assert of("ARG") == []


def test_the_page_runs_the_commands_that_exist() -> None:
    (entry,) = of("ENTRYPOINT")
    assert json.loads(entry) == ["doorstate"]
    shown = re.findall(r"no-new-privileges doorstate(?: (\w[^\n]*))?", PAGE)
    assert len(shown) == 2
    for arguments in filter(None, shown):
        helped = subprocess.check_output(
            [sys.executable, "-m", "doorstate", arguments.split()[0], "--help"], text=True
        )
        assert all(flag in helped for flag in re.findall(r"--[a-z-]+", arguments) if flag != "--no-open")
    script = (ROOT / "tools/container.sh").read_text(encoding="utf-8")
    for option in ("--read-only", "--tmpfs /tmp", "--cap-drop ALL", "--security-opt no-new-privileges"):
        assert option in PAGE
        assert option in script


@pytest.mark.slow
def test_command_and_health_check_work() -> None:
    (command,), (check,) = of("CMD"), of("HEALTHCHECK")
    arguments = json.loads(command)
    assert arguments[0] == "serve"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    arguments[arguments.index("--port") + 1] = str(port)
    python, *rest = json.loads(check.partition(" CMD ")[2])
    assert python == "python"
    checked = [sys.executable, *(word.replace(":8000", f":{port}") for word in rest)]
    program = [sys.executable, "-m", "doorstate", *arguments, "--rule", "plane_state", "--workers", "1"]
    service = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end_s = time.monotonic() + 60
        while subprocess.run(checked, capture_output=True, check=False).returncode:
            assert service.poll() is None
            assert time.monotonic() < end_s
    finally:
        service.terminate()
    assert service.wait(timeout=30) == 0
    assert subprocess.run(checked, capture_output=True, check=False).returncode != 0


def test_scripts_are_valid() -> None:
    bash = shutil.which("bash")
    assert bash is not None
    assert subprocess.run([bash, "-n", ROOT / "tools/container.sh"], check=False).returncode == 0


def test_hooks_name_programs_of_the_environment() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0][
        "hooks"
    ]
    scripts = {path.name for path in Path(sys.executable).parent.iterdir()}
    for hook in hooks:
        program = Path(hook["entry"].split()[0])
        assert (program.parent.as_posix(), hook["language"]) == (".venv/bin", "system")
        assert program.name in scripts
