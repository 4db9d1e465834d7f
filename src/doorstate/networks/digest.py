# SPDX-License-Identifier: Apache-2.0
"""SHA-256 of weights files and exported networks, in their own cards: a file with a changed byte is not used.

The digest is that of the file with zeros in its place, so it covers tensors, graph and card. Packaged files have theirs
in `digests.json` beside them. Files of version 0.1 have none.
"""

from __future__ import annotations

import hashlib
import json
import re
from functools import cache
from pathlib import Path

from doorstate._files import write_text
from doorstate.errors import WeightsError
from doorstate.networks.card import DIGEST_KEY, WeightsCard
from doorstate.networks.packaged import PRETRAINED

DIGESTS_FILE = "digests.json"
_BLANK = "sha256:" + "0" * 64
# A card is a string in the header of a weights file, which escapes its quotes, and plain in an exported network.
_DIGEST = re.compile(rb'\\?"%s\\?": ?\\?"(sha256:[0-9a-f]{64})' % DIGEST_KEY.encode())


def card_with_digest(card: WeightsCard) -> str:
    """Return the JSON of a card, with a place for the digest that `add_digest` fills."""
    return json.dumps({DIGEST_KEY: _BLANK, **card.model_dump(mode="json")})


def add_digest(content: bytes) -> bytes:
    """Return the bytes of a file with its digest in its card, which `card_with_digest` made."""
    return _with_digest(content, _digest(content))


def check_digest(content: bytes, path: Path) -> None:
    """Compare the bytes of a weights file or exported network with its digest, if there is one.

    Raises:
        WeightsError: they differ.
    """
    if path.parent == PRETRAINED:
        expected, actual = packaged_digests().get(path.name), _digest(content)
    elif found := _DIGEST.search(content):
        expected, actual = found[1].decode(), _digest(_with_digest(content, _BLANK))
    else:
        return
    if expected != actual:
        raise WeightsError(
            "differs from its digest",
            path=path,
            expected=expected,
            hint="restore the file; if the change is meant, remove the digest from its card",
        )


@cache
def packaged_digests() -> dict[str, str]:
    """Return the digests of the packaged files by name."""
    digests: dict[str, str] = json.loads((PRETRAINED / DIGESTS_FILE).read_text(encoding="utf-8"))
    return digests


def write_packaged_digests() -> Path:
    """Write the digests of the packaged files, and return the path."""
    files = sorted((*PRETRAINED.glob("*.safetensors"), *PRETRAINED.glob("*.onnx")))
    path = PRETRAINED / DIGESTS_FILE
    write_text(path, json.dumps({file.name: _digest(file.read_bytes()) for file in files}, indent=2) + "\n")
    packaged_digests.cache_clear()
    return path


def _digest(content: bytes) -> str:
    return f"sha256:{hashlib.sha256(content).hexdigest()}"


def _with_digest(content: bytes, digest: str) -> bytes:
    found = _DIGEST.search(content)
    assert found is not None
    return content[: found.start(1)] + digest.encode() + content[found.end(1) :]
