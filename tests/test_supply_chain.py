# SPDX-License-Identifier: Apache-2.0
"""What is installed and released: lock files, audit, workflows, addresses and the security policy."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LOCKS = (
    "requirements.lock",
    "requirements-light.lock",
    "requirements-container.lock",
    "tools/release.lock",
    "ros2/requirements.lock",
)
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "ros2").rglob("*.md")]


def locked(name: str) -> dict[Requirement, list[str]]:
    """Return requirements and the SHA-256 sums of their files."""
    lines = (ROOT / name).read_text(encoding="utf-8").replace("# optional: ", "").replace("\\\n", " ")
    entries = [line.split(" --hash=") for line in lines.splitlines() if not line.startswith("#")]
    return {
        Requirement(requirement.strip()): [part.strip() for part in sums] for requirement, *sums in entries
    }


def needed(*extras: str) -> set[str]:
    """Return the names of all packages that the project needs on this machine, as the installed ones declare."""
    own = PROJECT["project"]
    groups = [own["dependencies"], *(own["optional-dependencies"][extra] for extra in extras)]
    queue = [Requirement(text) for group in groups for text in group]
    seen: set[tuple[str, str]] = set()
    while queue:
        requirement = queue.pop()
        name = canonicalize_name(requirement.name)
        for extra in ("", *requirement.extras):
            if (name, extra) in seen or not (requirement.marker is None or requirement.marker.evaluate()):
                continue
            seen.add((name, extra))
            if name == "doorstate":
                queue += [Requirement(text) for text in own["optional-dependencies"].get(extra, [])]
                continue
            for text in distribution(name).requires or []:
                found = Requirement(text)
                if found.marker is None or found.marker.evaluate({"extra": extra}):
                    found.marker = None
                    queue.append(found)
    return {name for name, _ in seen} - {"doorstate"}


@pytest.mark.parametrize("lock", LOCKS)
def test_every_locked_package_has_one_version_and_its_sums(lock: str) -> None:
    for requirement, sums in locked(lock).items():
        assert [clause.operator for clause in requirement.specifier] == ["=="], str(requirement)
        assert requirement.url is None
        assert sums, str(requirement)
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", entry) for entry in sums), str(requirement)
    here = [entry.name for entry in locked(lock) if entry.marker is None or entry.marker.evaluate()]
    assert len(here) == len(set(here))


@pytest.mark.parametrize(
    ("lock", "extras"),
    [
        ("requirements.lock", ["dev", "fast"]),
        ("requirements-light.lock", []),
        ("requirements-container.lock", ["serve", "mqtt"]),
    ],
)
def test_exactly_what_the_project_needs_is_locked(lock: str, extras: list[str]) -> None:
    here = {entry.name for entry in locked(lock) if entry.marker is None or entry.marker.evaluate()}
    if "fast" in extras:
        pytest.importorskip("fpsample")
    assert {canonicalize_name(name) for name in here} == needed(*extras)


def test_locks_agree_and_fit_the_project() -> None:
    everything = {str(entry): sums for entry, sums in locked("requirements.lock").items()}
    versions = {entry.name: entry.specifier for entry in locked("requirements.lock")}
    for entry, sums in (locked("requirements-light.lock") | locked("requirements-container.lock")).items():
        assert (entry.specifier, sums) == (versions[entry.name], sums)
        if str(entry) in everything:
            assert sums == everything[str(entry)]
    for text in [*PROJECT["project"]["dependencies"], *PROJECT["project"]["optional-dependencies"]["dev"]]:
        wanted = Requirement(text)
        if wanted.name != "doorstate":
            (clause,) = versions[canonicalize_name(wanted.name)]
            assert wanted.specifier.contains(clause.version), text


def test_setup_installs_nothing_without_its_sum() -> None:
    for script in ("setup.sh", "dist.sh", "test_ros2.sh"):
        text = (ROOT / "tools" / script).read_text(encoding="utf-8").replace("\\\n", " ")
        installs = re.findall(r"^ *(?:install|\S+ -m pip install) [^\n]*", text, flags=re.MULTILINE)
        assert installs
        assert all("--require-hashes" in line or "--no-deps" in line for line in installs), script


def test_no_page_looks_for_all_packages_in_a_second_index() -> None:
    texts = {page: page.read_text(encoding="utf-8") for page in PAGES}
    assert [page.name for page, text in texts.items() if "--extra-index-url" in text] == []
    for page, text in texts.items():
        for index in re.findall(r"pip install ([^`\n]*)\s--index-url", text):
            assert index == "torch", page


@pytest.mark.parametrize(
    ("packages", "code", "said"),
    [
        (None, 0, "skipped"),
        ([{"name": "a", "skip_reason": "unknown"}], 0, "skipped"),
        ([{"name": "a", "version": "1", "vulns": []}], 0, "1 packages, 0 vulnerabilities"),
        ([{"name": "a", "version": "1", "vulns": [{"id": "X-1", "fix_versions": ["2"]}]}], 1, "a 1: X-1"),
    ],
)
def test_audit(packages: list[dict[str, Any]] | None, code: int, said: str, tmp_path: Path) -> None:
    write = f"open(sys.argv[sys.argv.index('--output') + 1], 'w').write({json.dumps({'dependencies': packages})!r})"
    (tmp_path / "pip_audit.py").write_text(f"import sys\n{write if packages else 'sys.exit(1)'}\n")
    command = [sys.executable, ROOT / "tools/audit.py"]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, "")
    assert said in done.stdout


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_workflows_pin_actions_and_ask_for_few_rights(path: Path) -> None:
    workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert workflow["permissions"] == {"contents": "read"}
    targets = set(
        re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    )
    for job in workflow["jobs"].values():
        uses = [job["uses"]] if "uses" in job else [step.get("uses", "./") for step in job["steps"]]
        assert all(re.fullmatch(r"\./.*|[\w./-]+@[0-9a-f]{40}", action) for action in uses)
        assert "uses" in job or job["timeout-minutes"] <= 60
        for step in job.get("steps", []):
            assert "secrets." not in str(step)
            if step.get("run", "").startswith("make "):
                assert step["run"].split()[1] in targets


def test_a_release_is_tested_attested_and_published_without_a_password() -> None:
    jobs = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8"))["jobs"]
    assert (jobs["build"]["needs"], jobs["publish"]["needs"]) == ("test", "build")
    used = {
        name: [step.get("uses", "").partition("@")[0] for step in job.get("steps", [])]
        for name, job in jobs.items()
    }
    assert {"actions/attest-build-provenance", "actions/attest"} <= set(used["build"])
    (materials,) = [step["with"] for step in jobs["build"]["steps"] if "sbom-path" in step.get("with", {})]
    assert materials["sbom-path"].removeprefix("dist") in (ROOT / "tools/dist.sh").read_text(encoding="utf-8")
    assert jobs["test"]["uses"] == "./.github/workflows/ci.yml"
    ci = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    assert {"run": "make audit", "env": {"PYTHON": "python"}} in ci["jobs"]["audit"]["steps"]
    assert "pypa/gh-action-pypi-publish" in used["publish"]
    assert jobs["publish"]["permissions"] == {"id-token": "write"}


def test_addresses_are_those_of_one_repository() -> None:
    urls = PROJECT["project"]["urls"]
    assert set(urls) == {"Homepage", "Documentation", "Source", "Issues", "Changelog"}
    assert all(address.startswith(urls["Source"]) for address in urls.values())
    for name in ("Documentation", "Changelog"):
        assert (ROOT / urls[name].partition("/blob/main/")[2]).is_file()
    assert urls["Source"] in (ROOT / "SECURITY.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_security_policy_is_linked(page: str) -> None:
    assert "SECURITY.md)" in (ROOT / page).read_text(encoding="utf-8")
