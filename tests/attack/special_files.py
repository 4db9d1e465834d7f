# SPDX-License-Identifier: Apache-2.0
"""Pipes, devices and sparse files in place of every kind of input: refused at once, in one line."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from tests.attack.processes import Command, run
from tests.attack.samples import first_cloud, prepared
from tests.attack.tries import Try, Violation

_CLOUDS = ("pcd", "ply", "npy", "npz", "xyz", "txt", "csv", "png")
_KINDS = ("pipe", "zeros", "sparse", "folder", "gone")
_LONGEST_S = 60.0


def attack_inputs(folder: Path, rounds: int) -> Iterator[Try]:
    """Put what is no file of usual size in place of the inputs of commands."""
    data = prepared(folder / "data", scenes=2)
    cloud = shutil.copy(first_cloud(folder), folder / "cloud.pcd")
    study = folder / "study"
    study.mkdir()
    cases: list[tuple[str, Path, list[object]]] = [
        *(("cloud", folder / f"c.{suffix}", ["predict", f"c.{suffix}"]) for suffix in _CLOUDS),
        ("bag", folder / "b.bag", ["predict", "--bag", "b.bag"]),
        ("bag", folder / "b.mcap", ["predict", "--bag", "b.mcap"]),
        ("camera file", folder / "k.yaml", ["predict", cloud, "--intrinsics", "k.yaml"]),
        ("index", folder / "index.csv", ["evaluate", folder]),
        ("weights", folder / "w.onnx", ["predict", cloud, "--weights", "w.onnx"]),
        ("weights", folder / "w.safetensors", ["predict", cloud, "--weights", "w.safetensors"]),
        ("experiment", folder / "e.toml", ["compare", "e.toml", "--out", "x"]),
        ("study", folder / "r.toml", ["resolution", "r.toml", "--out", "x"]),
        ("study", folder / "t.toml", ["transfer", "t.toml", "--out", "x"]),
        ("comparison", study / "experiment.json", ["report", study]),
        *(
            ("data set", data / name, ["train", "--network", "pointnet", "--data", data, "--out", "x"])
            for name in ("dataset.json", "manifest.csv", "clouds.npy")
        ),
    ]
    for kind, path, arguments in cases[:: 1 if rounds > 1 else 7]:
        before = path.read_bytes() if path.is_file() else None
        for special in _KINDS:
            path.unlink(missing_ok=True)
            _put(path, special)
            done = Command(folder, arguments).wait(_LONGEST_S)
            hangs = Try(f"{special} as {path.name}", "hangs", Violation.UNCAUGHT)
            yield (
                hangs
                if done.code == -9
                else done.as_try(f"{kind}: a pipe, device, sparse file, folder or none")
            )
            path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink(missing_ok=True)
        if before is not None:
            path.write_bytes(before)


def attack_large(folder: Path, rounds: int) -> Iterator[Try]:
    """Put files that are too large among others, which are answered."""
    cloud = first_cloud(prepared(folder / "data", scenes=1).with_name("data-raw"))
    many = folder / "many"
    many.mkdir()
    for name in ("a.pcd", "d.pcd"):
        shutil.copy(cloud, many / name)
    for name in ("b.pcd", "c.npy", "e.txt"):
        _put(many / name, "sparse")
    done = run(folder, "predict", many, "--out", "out.csv")
    lines = (folder / "out.csv").read_text().splitlines()
    is_written = (
        done.code == 1
        and sum(line.startswith(("many/a", str(many / "a"), "many/d", str(many / "d"))) for line in lines)
        == 2
    )
    yield Try(
        "files of 200 GB among others",
        "others answered and written" if is_written else done.err,
        None if is_written else Violation.UNCAUGHT,
    )


def _put(path: Path, kind: str) -> None:
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "zeros":
            path.symlink_to("/dev/zero")
        case "sparse":
            path.touch()
            os.truncate(path, 200 << 30)
        case "folder":
            path.mkdir()
