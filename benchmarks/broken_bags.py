# SPDX-License-Identifier: Apache-2.0
"""Recordings that no robot made: a few valid ones of every kind, and ways to break them."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.bags import Message, camera_info, cloud, compressed_image, image, text, write_bag
from benchmarks.mutations import MESSAGES, YAML_TOKENS, draw_broken, draw_depth, draw_file, draw_points
from doorstate.types import Points

BAG_SUFFIXES = (".bag", ".db3", ".mcap")
_VARIANTS = 30  # of each kind: writing is slow
_COMPRESSIONS = {
    ".bag": ("", "", "LZ4", "BZ2"),
    ".db3": ("", "", "", "MESSAGE"),
    ".mcap": ("", "", "STORAGE"),
}
_FOLDERS = (("db3", ""), ("db3", "MESSAGE"), ("db3", "FILE"), ("mcap", ""), ("mcap", "STORAGE"))


class Recordings:
    """Bags in a folder of their own, each written when it is first asked for.

    Args:
        folder: does not exist yet.
        scene: (H, W, 3) organized cloud that a state can be told from.
    """

    def __init__(self, folder: Path, scene: Points) -> None:
        folder.mkdir(parents=True)
        self._folder = folder
        self._scene = scene
        self._written: dict[tuple[str, int], bytes] = {}

    def draw(self, rng: np.random.Generator, suffix: str) -> bytes:
        """One file of a recording, broken in four cases of five."""
        return draw_broken(rng, lambda: self.valid(suffix, int(rng.integers(_VARIANTS))))

    def draw_metadata(self, rng: np.random.Generator) -> bytes:
        """`metadata.yaml` of one of the recordings in `folder_with`, broken in four cases of five."""
        written = self._stores[1]
        return draw_broken(rng, lambda: written[rng.integers(len(written))], YAML_TOKENS)

    def valid(self, suffix: str, variant: int) -> bytes:
        """One file of a recording; the same number is the same recording."""
        if (suffix, variant) not in self._written:
            rng = np.random.default_rng((BAG_SUFFIXES.index(suffix), variant))
            kind, compression = suffix[1:], str(rng.choice(_COMPRESSIONS[suffix]))
            path = write_bag(self._folder / f"{kind}{variant}", kind, self._messages(rng), compression)
            file = path if path.is_file() else path / f"{path.name}{suffix}"
            self._written[suffix, variant] = file.read_bytes()
        return self._written[suffix, variant]

    def file_with(self, suffix: str, content: bytes) -> Path:
        """A file that holds this."""
        path = self._folder / f"broken{suffix}"
        path.write_bytes(content)
        return path

    def folder_with(self, metadata: bytes) -> Path:
        """The folder of a ROS 2 recording with this `metadata.yaml`, whichever recording it is of."""
        folder = self._stores[0]
        (folder / "metadata.yaml").write_bytes(metadata)
        return folder

    @cached_property
    def _stores(self) -> tuple[Path, list[bytes]]:
        """The files of all folders in one, and their metadata."""
        together, metadata = self._folder / "together", []
        together.mkdir()
        for kind, compression in _FOLDERS:
            messages = self._messages(np.random.default_rng(2))
            folder = write_bag(self._folder / f"{kind}{compression}", kind, messages, compression)
            (store,) = folder.glob(f"{folder.name}.*")
            name = f"{compression}{store.name}"
            store.rename(together / name)
            metadata.append(
                (folder / "metadata.yaml").read_bytes().replace(store.name.encode(), name.encode())
            )
        return together, metadata

    def _messages(self, rng: np.random.Generator) -> list[Message]:
        """Clouds, depth images with their camera, or both."""
        height, width = self._scene.shape[:2]
        centre = (width / 2, 0, width / 2, 0, width / 2, height / 2, 0, 0, 1)
        info = camera_info("/depth/camera_info", width, height, centre, [0] * 12)
        kinds = rng.choice(MESSAGES, int(rng.integers(1, 4)))
        return [info, text("/chatter"), *(draw_valid_message(rng, str(kind), self._scene) for kind in kinds)]


def draw_valid_message(rng: np.random.Generator, kind: str, scene: Points) -> Message:
    """One of `MESSAGES` that drivers send, though its points may hold nothing."""
    match kind:
        case "PointCloud2":
            return cloud("/points", draw_points(rng, scene))
        case "CompressedImage":
            png = bytes(12) + draw_file(rng, ".png", scene)
            return compressed_image("/depth/raw/compressedDepth", png, "16UC1; compressedDepth png")
    if rng.random() < 0.5:
        return image("/depth/raw", draw_depth(rng, scene, "<u2"), "16UC1")
    return image("/depth/metres", draw_depth(rng, scene, "<f4"), "32FC1")
