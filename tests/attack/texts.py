# SPDX-License-Identifier: Apache-2.0
"""Settings that are nested too deeply, integers of thousands of digits, absurd sizes; file names that are code."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from doorstate.errors import CameraError
from doorstate.simulation.camera import DepthCamera
from tests.attack.processes import run
from tests.attack.samples import first_cloud, simulated
from tests.attack.tries import Try, Violation, attempt
from tests.fuzz.settings_files import read_content, read_settings, seeds

_FILES = (
    "experiment.toml",
    "resolution.toml",
    "transfer.toml",
    "comparison.json",
    "simulation.json",
    "weights.safetensors",
    "network.onnx",
    "data/dataset.json",
    "experiment.json",
    "metrics.json",
)
_DEEP, _LONG = 20_000, "9" * 5000
_NUMBERS = (
    "1e18",
    "-1",
    "1e400",
    "nan",
    "inf",
    _LONG,
    "0x" + "f" * 5000,
    "[[[[1]]]]",
    "null",
    '"x"',
    "1" * 25,
)
_NAMES = (
    "=1+1",
    "+1",
    "-1",
    "@SUM(A1)",
    "\x1b]0;x\x07",
    "\x1b[31m",
    "<script>alert(1)</script>",
    "a\nb",
    'a"b,c',
    "\u202efdp",
    "'x",
    "[red]x",
)


def attack_settings(folder: Path, rounds: int) -> Iterator[Try]:
    """Replace the numbers of settings, and nest them."""
    for name in _FILES:
        seed = seeds(name)[0].decode()
        nested = [
            "[" * _DEEP,
            '{"a":' * _DEEP,
            f"a = {'[' * _DEEP}",
            f"{'a.' * _DEEP}b = 1",
            f"a = {_LONG}",
            f'{{"a": {_LONG}}}',
        ]
        for text in (*nested, seed.replace("{", '{"deep":' + "[" * _DEEP, 1)):
            yield attempt("settings nested deeply, or with 5000 digits", partial(_read, text, name))
        pieces = [
            place for place, letter in enumerate(seed) if letter.isdigit() and not seed[place - 1].isalnum()
        ]
        for place in pieces[:: max(1, len(pieces) // rounds)]:
            end = place + next(
                (n for n, c in enumerate(seed[place:]) if not (c.isalnum() or c in ".")), len(seed) - place
            )
            for number in _NUMBERS:
                yield attempt(
                    "absurd numbers in settings", partial(_read, seed[:place] + number + seed[end:], name)
                )
    for size in ((10**9, 10**9), (0, 1), (-1, 5), (10**18, 1), (5000, 5000)):
        yield attempt("absurd cameras", partial(_camera, *size))


def attack_file_names(folder: Path, rounds: int) -> Iterator[Try]:
    """Give clouds names that terminals, spreadsheets and browsers would obey."""
    cloud, many = first_cloud(simulated(folder / "raw", scenes=1)), folder / "many"
    many.mkdir()
    for name in _NAMES:
        if "/" not in name:
            shutil.copy(cloud, many / f"{name}.pcd")
    shutil.copy(cloud, many / "<img src=x onerror=alert(1)>.pcd")
    options = ["--rule", "plane_state"]
    table = run(many, "predict", ".", *options)
    yield table.as_try("hostile file names")
    yield _check("in a table", table.out + table.err)
    yield _check("as JSON", run(many, "predict", ".", *options, "--json").out)
    run(many, "predict", ".", *options, "--out", folder / "out.csv")
    with (folder / "out.csv").open(newline="") as stream:
        cells = [row["file"] for row in csv.DictReader(stream)]
    yield _check("in CSV", (folder / "out.csv").read_text())
    is_formula = any(cell[:1] in "=+-@" for cell in cells)
    yield Try(
        "hostile file names in CSV",
        "formula" if is_formula else "harmless",
        Violation.OBEYED if is_formula else None,
    )
    for line in (
        ["view", ".", "--no-open", "--out", folder / "v.html"],
        ["evaluate", ".", "--out", folder / "e"],
    ):
        if line[0] == "evaluate":
            (many / "index.csv").write_text(
                "file,state\n"
                + "".join(
                    f'"{p.name.replace(chr(34), chr(34) * 2)}",open\n' for p in sorted(many.glob("*.pcd"))
                )
            )
        done = run(many, *line, *options)
        yield done.as_try("hostile file names")
        yield _check(f"in `{line[0]}`", done.out + done.err)
        for page in (*folder.glob("*.html"), *folder.glob("e/*.html")):
            yield _check_page(page.read_text())


def _read(text: str, name: str) -> str:
    content = text.encode()
    return (
        "refused"
        if name.endswith((".safetensors", ".onnx")) and read_content(content, name)
        else read_settings(content, name)
    )


def _camera(width: int, height: int) -> str:
    try:
        DepthCamera(width=width, height=height)
    except (CameraError, ValueError):
        return "refused"
    assert width * height < 1 << 26
    return "read"


def _check(where: str, text: str) -> Try:
    is_obeyed = any((ord(letter) < 32 and letter not in "\n\r") or letter in "\x9b\u202e" for letter in text)
    return Try(
        f"hostile file names {where}",
        "obeyed" if is_obeyed else "harmless",
        Violation.OBEYED if is_obeyed else None,
    )


def _check_page(page: str) -> Try:
    is_obeyed = "<script>alert(1)" in page or "<img src=x" in page
    return Try(
        "hostile file names in pages",
        "obeyed" if is_obeyed else "harmless",
        Violation.OBEYED if is_obeyed else None,
    )
