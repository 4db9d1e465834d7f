# SPDX-License-Identifier: Apache-2.0
"""Formats of files, by name and by content; what to do with files in other formats."""

from __future__ import annotations

import gzip
import io
import re
import zlib
from pathlib import PurePath

from doorstate.errors import CloudReadError
from doorstate.io.size_limits import MAX_FILE_BYTES, check_byte_count

CLOUD_SUFFIXES = (".pcd", ".ply", ".npy", ".npz", ".xyz", ".txt", ".csv", ".png")
BAG_SUFFIXES = (".bag", ".db3", ".mcap")
OPEN_BAG_HINT = "open recordings as ROS bags"
_GZIP_SUFFIX = ".gz"
_GZIP = b"\x1f\x8b"  # RFC 1952
_MAGIC = (
    (re.compile(rb"\x93NUMPY"), ".npy"),
    (re.compile(rb"PK\x03\x04"), ".npz"),
    (re.compile(rb"\x89PNG\r\n\x1a\n"), ".png"),
    (re.compile(rb"ply\s"), ".ply"),
    (re.compile(rb"(?:#[^\r\n]*\s+)*VERSION[ \t]+0?\.[0-9]\s"), ".pcd"),
)
_LAS = (
    "convert it: pip install 'laspy[lazrs]', then python -c \"import laspy, numpy; las = laspy.read('cloud{}'); "
    "numpy.save('cloud.npy', numpy.c_[las.x, las.y, las.z])\""
)
_E57 = (
    'convert it: pip install pye57, then python -c "import numpy, pye57; '
    "scan = pye57.E57('cloud{}').read_scan_raw(0); "
    "numpy.save('cloud.npy', numpy.stack([scan['cartesian' + axis] for axis in 'XYZ'], -1))\""
)
_MESH = (
    'convert it: pip install trimesh, then python -c "import trimesh; '
    "trimesh.load('cloud{}', force='mesh').export('cloud.ply')\""
)
_TIFF = (
    'convert it: python -c "import numpy; from PIL import Image; '
    "numpy.save('depth.npy', numpy.asarray(Image.open('depth{}')))\""
)
_HINTS = dict.fromkeys((".las", ".laz"), _LAS) | {".e57": _E57}
_HINTS |= dict.fromkeys((".obj", ".stl", ".off", ".glb"), _MESH)
_HINTS |= dict.fromkeys(BAG_SUFFIXES, OPEN_BAG_HINT)
_HINTS |= dict.fromkeys((".tif", ".tiff"), _TIFF)
_HINTS |= dict.fromkeys((".jpg", ".jpeg"), "JPEG loses depth: save depth images as PNG with 16 bit")


def format_suffix(name: str | PurePath) -> str:
    """Return the suffix of a file name in lower case, such as `.pcd`, also of `cloud.pcd.gz`."""
    path = PurePath(name)
    if path.suffix.lower() == _GZIP_SUFFIX:
        path = path.with_suffix("")
    return path.suffix.lower()


def suffix_of_content(data: bytes) -> str | None:
    """Return the suffix of the format that the first bytes of a file show, or None: tables of text show none."""
    return next((suffix for magic, suffix in _MAGIC if magic.match(data, 0, 1 << 12)), None)


def check_suffix(suffix: str) -> None:
    """Check that files with this suffix can be read.

    Raises:
        CloudReadError: they cannot; the hint says how to convert them.
    """
    if suffix.lower() not in CLOUD_SUFFIXES:
        raise CloudReadError(
            f"unknown file type {suffix!r}", expected=" ".join(CLOUD_SUFFIXES), hint=conversion_hint(suffix)
        )


def conversion_hint(suffix: str) -> str | None:
    """Return how to convert files with this suffix, or None."""
    hint = _HINTS.get(suffix.lower())
    return hint and hint.replace("{}", suffix.lower())


def unpack_gzip(data: bytes) -> bytes:
    """Return the content of gzip data, and other data unchanged.

    Raises:
        CloudReadError: damaged, or larger than one camera frame.
    """
    content = unpack_at_most(data, MAX_FILE_BYTES + 1)
    check_byte_count(len(content))
    return content


def unpack_at_most(data: bytes, max_bytes: int) -> bytes:
    """Return the first bytes of the content of gzip data, and of other data unchanged.

    Raises:
        CloudReadError: damaged.
    """
    if data[: len(_GZIP)] != _GZIP:
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            return stream.read(max_bytes)
    except (OSError, EOFError, zlib.error) as error:
        raise CloudReadError(f"is damaged gzip data ({error})") from error
