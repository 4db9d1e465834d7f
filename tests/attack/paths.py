# SPDX-License-Identifier: Apache-2.0
"""Names that lead out of their folder, in tables, experiments, studies, bags and options."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from doorstate.clouds.preparation import MIN_POINTS
from tests.attack.processes import run
from tests.attack.samples import contents, first_cloud, prepared
from tests.attack.tries import Try, Violation

_NAMES = (
    "../x",
    "../../x",
    "/tmp/doorstate-attack/x",
    "a/../../x",
    "link/x",
    "..",
    ".",
    "",
    "x\u0000",
    "\u202ex",
    "a/b",
)


def attack_names(folder: Path, rounds: int) -> Iterator[Try]:
    """Name files outside of the folder of a table, and folders outside of `runs`."""
    data = prepared(folder / "data", scenes=12)
    secret = Path(shutil.copy(first_cloud(folder), folder / "x"))
    shutil.copy(secret, folder / "x.pcd")
    work = folder / "work"
    work.mkdir()
    (work / "link").symlink_to(folder)
    shutil.copy(secret, work / "a.pcd")
    for name in _NAMES if rounds > 1 else _NAMES[:2]:
        for column in ("file", "rgb"):
            row = f"{name}.pcd,open," if column == "file" else f"a.pcd,open,{name}"
            (work / "index.csv").write_text(f"file,state,rgb\n{row}\n", encoding="utf-8")
            yield from _try(
                f"`{column}` in index.csv",
                folder,
                work,
                ["evaluate", ".", "--rule", "plane_state", "--out", "out"],
            )
        (work / "index.csv").unlink()
        text = (
            f'name = {_quoted(name)}\ndataset = "{data}"\nrules = ["plane_state"]\nnetworks = []\nfolds = 1\n'
        )
        (work / "e.toml").write_text(text, encoding="utf-8")
        yield from _try("name of an experiment", folder, work, ["compare", "e.toml"])
        (work / "t.toml").write_text(
            f'networks = ["pointnet"]\nnum_points = {MIN_POINTS}\n'
            f'[trained]\n{_quoted(name)} = "{data}"\n[tested]\nb = "{data}"\n',
            encoding="utf-8",
        )
        yield from _try("name in a transfer study", folder, work, ["transfer", "t.toml"])
        yield from _try(
            "name of packaged weights",
            folder,
            work,
            ["predict", "a.pcd", "--network", name.replace("\0", "")],
        )


def _try(kind: str, folder: Path, work: Path, arguments: list[object]) -> Iterator[Try]:
    before = {name: content for name, content in contents(folder).items() if not name.startswith("work/")}
    done = run(work, *arguments)
    after = {name: content for name, content in contents(folder).items() if not name.startswith("work/")}
    if before != after or Path("/tmp/doorstate-attack").exists():
        yield Try(kind, "written outside", Violation.OUTSIDE)
    else:
        yield done.as_try(kind)
    for made in ("out", "runs"):
        shutil.rmtree(work / made, ignore_errors=True)


def _quoted(name: str) -> str:
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in name) + '"'
