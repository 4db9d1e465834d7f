# SPDX-License-Identifier: Apache-2.0
"""Imports point up only: each room of the house may use the rooms above it (docs/concepts.md, "The house")."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "doorstate"
# A module may import from its own line and the lines above.
ORDER = (
    ("errors", "types", "__init__"),
    ("files", "models"),
    ("jobs",),
    ("clouds",),
    ("simulation",),
    ("dataset",),
    ("networks",),
    ("rules",),
    ("training",),
    ("evaluation",),
    ("deployment",),
    ("console", "cli"),
)
# A network knows tensors only.
FORBIDDEN = {"networks": {"clouds", "simulation", "dataset", "files", "models", "jobs"}}
# The package's public names are looked up when they are asked for.
LAZY = {"__init__"}


def room(module: str) -> str:
    """Top-level room of `doorstate.room.module`; the package itself is `__init__`."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def imported_rooms(path: Path, package: Path) -> set[str]:
    """Rooms that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            if node.level:
                raise SystemExit(f"{path.relative_to(package)}:{node.lineno}: relative import")
            names = [
                f"{node.module}.{alias.name}" if node.module == package.name else str(node.module)
                for alias in node.names
            ]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        found |= {room(name) for name in names if name.split(".")[0] == package.name}
    return {
        name if (package / name).exists() or (package / f"{name}.py").exists() else "__init__"
        for name in found
    }


def violations(package: Path = PACKAGE) -> list[str]:
    """One line for every import that points down."""
    rank = {name: number for number, names in enumerate(ORDER) for name in names}
    lines = []
    for path in sorted(package.rglob("*.py")):
        own = path.relative_to(package).parts[0].removesuffix(".py")
        if own in LAZY:
            continue
        if own not in rank:
            lines.append(f"{path.relative_to(package)}: room {own!r} has no place in tools/check_imports.py")
            continue
        for name in sorted(imported_rooms(path, package)):
            # A room without a place is reported once, by its own files.
            if rank.get(name, 0) > rank[own] or name in FORBIDDEN.get(own, ()):
                lines.append(f"{path.relative_to(package)}: {own} must not import {name}")
    return lines


if __name__ == "__main__":
    found = violations()
    sys.exit("\n".join(found) if found else 0)
