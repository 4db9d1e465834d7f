# SPDX-License-Identifier: Apache-2.0
"""The check of imports: the package passes it, and what it is there to find is found."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

TOOL = Path(__file__).resolve().parents[1] / "tools" / "check_imports.py"


@pytest.fixture(scope="module")
def check() -> ModuleType:
    spec = importlib.util.spec_from_file_location("check_imports", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def house(folder: Path, **files: str) -> Path:
    """A package of the given rooms: `clouds__io` is clouds/io.py."""
    package = folder / "doorstate"
    for name, code in {
        "errors": "",
        "clouds__io": "",
        "dataset__store": "",
        "networks__ops": "",
        **files,
    }.items():
        path = package / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code, encoding="utf-8")
    return package


def test_the_package_passes() -> None:
    done = subprocess.run([sys.executable, TOOL], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_check_reads_the_whole_package(check: ModuleType) -> None:
    seen = {
        name for path in check.PACKAGE.rglob("*.py") for name in check.imported_rooms(path, check.PACKAGE)
    }
    assert {"errors", "types", "clouds", "simulation", "dataset", "networks"} <= seen


@pytest.mark.parametrize(
    "code",
    [
        "from doorstate.errors import X",
        "import doorstate.clouds.io",
        "from doorstate import clouds",
        "from doorstate import __version__",
        "import numpy.clouds",
    ],
)
def test_upward_imports_pass(check: ModuleType, tmp_path: Path, code: str) -> None:
    assert check.violations(house(tmp_path, dataset__store=code)) == []


@pytest.mark.parametrize(
    "code",
    [
        "from doorstate.dataset.store import X",
        "from doorstate.dataset import store",
        "import doorstate.dataset.store as x",
        "from doorstate import dataset",
        "import numpy, doorstate.dataset",
        "def f():\n    from doorstate.dataset import store",
        "if TYPE_CHECKING:\n    import doorstate.dataset.store",
    ],
)
def test_a_downward_import_is_found(check: ModuleType, tmp_path: Path, code: str) -> None:
    found = check.violations(house(tmp_path, clouds__io=code))
    assert found == [f"{Path('clouds/io.py')}: clouds must not import dataset"]


@pytest.mark.parametrize("room", ["dataset", "clouds"])
def test_a_network_that_knows_more_than_tensors_is_found(
    check: ModuleType, tmp_path: Path, room: str
) -> None:
    found = check.violations(house(tmp_path, networks__ops=f"import doorstate.{room}"))
    assert found == [f"{Path('networks/ops.py')}: networks must not import {room}"]


def test_a_relative_import_is_found(check: ModuleType, tmp_path: Path) -> None:
    package = house(tmp_path, clouds__io="import math\nfrom .pcd import x")
    with pytest.raises(SystemExit, match=r"io\.py:2: relative import"):
        check.violations(package)


def test_a_room_without_a_place_is_found(check: ModuleType, tmp_path: Path) -> None:
    package = house(tmp_path, attic__box="", clouds__io="import doorstate.attic.box")
    assert check.violations(package) == [
        f"{Path('attic/box.py')}: room 'attic' has no place in tools/check_imports.py"
    ]
