# SPDX-License-Identifier: Apache-2.0
"""ROS 2 package without ROS: its files agree with each other, with the node and with its README."""

from __future__ import annotations

import ast
import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from doorstate_ros.settings import LIVE, NodeSettings, parse_node_settings

import doorstate
from doorstate.inference.watch import DoorWatch
from doorstate.inference.watch_settings import WatchSettings
from tests.ros2.package import PACKAGE, ROS2

SOURCES = {path.stem: path.read_text(encoding="utf-8") for path in (PACKAGE / "doorstate_ros").glob("*.py")}
NODE = SOURCES["node"]
LAUNCH = PACKAGE / "launch" / "doorstate.launch.py"
README = (ROS2 / "README.md").read_text(encoding="utf-8")
PAGES = README + (ROS2.parent / "docs" / "nav2-open-rmf.md").read_text(encoding="utf-8")


@pytest.fixture(params=["doorstate_ros", "doorstate_nav"])
def package(request: pytest.FixtureRequest) -> Path:
    """Folder of a package in Python."""
    return ROS2 / str(request.param)


@pytest.fixture
def manifest(package: Path) -> ElementTree.Element:
    return ElementTree.parse(package / "package.xml").getroot()


@pytest.fixture
def setup_arguments(package: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    seen: dict[str, Any] = {}
    monkeypatch.chdir(package)
    monkeypatch.setattr("setuptools.setup", lambda **arguments: seen.update(arguments))
    runpy.run_path("setup.py")
    return seen


def imported(source: str) -> set[str]:
    """Top-level packages."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(str(node.module).partition(".")[0])
        elif isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
    return found


def strings(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_name_version_and_licence_are_the_same_everywhere(
    package: Path, manifest: ElementTree.Element, setup_arguments: dict[str, Any]
) -> None:
    for key in ("name", "version", "license", "description", "maintainer"):
        assert manifest.findtext(key) == setup_arguments[key], key
    assert setup_arguments["version"] == doorstate.__version__
    assert manifest.findtext("export/build_type") == "ament_python"
    assert setup_arguments["packages"] == [setup_arguments["name"]] == [package.name]
    assert f"/lib/{package.name}" in (package / "setup.cfg").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["doorstate_msgs", "doorstate_bt"])
def test_packages_of_cmake_have_the_version_too(name: str) -> None:
    root = ElementTree.parse(ROS2 / name / "package.xml").getroot()
    assert (root.findtext("name"), root.findtext("version")) == (name, doorstate.__version__)
    assert f"project({name})" in (ROS2 / name / "CMakeLists.txt").read_text(encoding="utf-8")


def test_files_are_installed_where_ros_searches_them(package: Path, setup_arguments: dict[str, Any]) -> None:
    installed = {
        f"{folder}/{Path(file).name}" for folder, files in setup_arguments["data_files"] for file in files
    }
    share = f"share/{package.name}"
    wanted = {
        f"{share}/{folder}/{path.name}"
        for folder in ("launch", "config")
        for path in (package / folder).iterdir()
    }
    assert installed == wanted | {
        f"{share}/package.xml",
        f"share/ament_index/resource_index/packages/{package.name}",
    }
    assert all(Path(file).is_file() for _, files in setup_arguments["data_files"] for file in files)


def test_entry_points_are_functions_that_launch_files_and_pages_name(
    package: Path, setup_arguments: dict[str, Any]
) -> None:
    launched = set().union(
        *(strings(path.read_text(encoding="utf-8")) for path in (package / "launch").iterdir())
    )
    for entry in setup_arguments["entry_points"]["console_scripts"]:
        executable, target = entry.split(" = ")
        module, function = target.split(":")
        source = (package / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")
        assert function in {node.name for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)}
        assert executable in launched or f"ros2 run {package.name} {executable}" in PAGES
        assert f"{executable}" in PAGES


def test_imports_are_declared(package: Path, manifest: ElementTree.Element) -> None:
    files = [*(package / package.name).glob("*.py"), *(package / "launch").iterdir()]
    used = set().union(*(imported(path.read_text(encoding="utf-8")) for path in files))
    declared = {element.text for element in manifest.iter("exec_depend")}
    assert used - set(sys.stdlib_module_names) - {"doorstate", "pydantic", package.name} == declared


def test_the_parameter_file_holds_every_parameter_with_its_default() -> None:
    content = yaml.safe_load((PACKAGE / "config" / "doorstate.yaml").read_text(encoding="utf-8"))
    parameters = content["/**"]["ros__parameters"]
    assert list(parameters) == list(NodeSettings.model_fields)
    assert parse_node_settings(parameters) == NodeSettings()
    for name, value in parameters.items():  # ROS takes a double without a point for an integer
        assert type(value) is type(NodeSettings.model_fields[name].default), name


def test_the_readme_lists_every_parameter_default_and_value() -> None:
    listed = dict(re.findall(r"^\| `(\w+)`\*? \| `([^`]*)` \|", README, flags=re.MULTILINE))
    defaults = {name: str(field.default) for name, field in NodeSettings.model_fields.items()}
    shown = {
        name: value.replace('""', "").replace("true", "True").replace("false", "False")
        for name, value in listed.items()
    }
    assert {name: shown.get(name) for name in defaults} == defaults
    for name in DoorWatch(WatchSettings(rule="depth_region")).report_silence(0).values:
        assert f"`{name}`" in README, name


def test_the_readme_marks_the_parameters_that_change_at_once() -> None:
    assert set(re.findall(r"^\| `(\w+)`\* \|", README, flags=re.MULTILINE)) == LIVE


def test_the_launch_file_compiles_and_names_the_topics_of_the_node() -> None:
    source = LAUNCH.read_text(encoding="utf-8")
    compile(source, LAUNCH.name, "exec")
    (topics,) = (
        ast.literal_eval(node.value)
        for node in ast.parse(source).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "TOPICS"
    )
    assert set(topics) == set(NodeSettings.model_fields["input"].annotation.__args__) | {"camera_info"}
    assert "camera_info" in strings(NODE)
    assert "config" in strings(source)
    for topic in topics:
        assert f"`{topic}`" in README, topic


def test_topics_of_the_readme_are_those_of_the_node() -> None:
    published = {text.removeprefix("~/") for text in strings(NODE) if text.startswith("~/")}
    assert set(re.findall(r"^\| `~/(\w+)` \|", README, flags=re.MULTILINE)) == published


def test_links_of_the_readme_exist() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    assert targets
    assert [target for target in targets if "://" not in target and not (ROS2 / target).exists()] == []


def test_the_profile_for_large_clouds_has_enough_shared_memory() -> None:
    root = ElementTree.parse(PACKAGE / "config" / "fastdds_large_clouds.xml").getroot()
    text = {element.tag.partition("}")[2]: element.text for element in root.iter()}
    largest_cloud = 640 * 480 * 32  # bytes; x, y, z and colour as drivers pad them
    assert int(text["maxMessageSize"]) > largest_cloud
    assert int(text["segment_size"]) >= 4 * int(text["maxMessageSize"])
