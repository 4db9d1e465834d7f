# SPDX-License-Identifier: Apache-2.0
"""Body of a prediction request: the file itself, packed by gzip, or one part of a form."""

from __future__ import annotations

from collections.abc import Mapping
from email.message import Message
from email.parser import BytesHeaderParser
from typing import NamedTuple

from fastapi import HTTPException

from doorstate.io.formats import (
    CLOUD_SUFFIXES,
    conversion_hint,
    format_suffix,
    suffix_of_content,
    unpack_at_most,
)

BODY_HEADERS = ("content-encoding", "content-type")
"""Headers that say how a body is to be read."""
_FORM = "multipart/form-data"
_MAX_PARTS, _MAX_PART_HEADER = 16, 1 << 13
_SUFFIX_OF_SUBTYPE = {"plain": ".txt"}  # media subtypes that differ from the suffix


class Upload(NamedTuple):
    """File of a request."""

    content: bytes
    name: str
    content_type: str

    @property
    def suffix(self) -> str:
        """Format of the file, by its name, its media type, or its first bytes.

        Raises:
            HTTPException: 415, not a format that can be read.
        """
        candidates = (
            format_suffix(self.name),
            suffix_of_type(self.content_type),
            suffix_of_content(self.content),
        )
        for suffix in candidates:
            if suffix in CLOUD_SUFFIXES:
                return suffix
        raise unknown_format(format_suffix(self.name))


def unknown_format(suffix: str = "") -> HTTPException:
    """Return the error of a file in a format that cannot be read, or that nothing tells.

    Args:
        suffix: of the file's name, where it has one.
    """
    formats = ", ".join(suffix.lstrip(".") for suffix in CLOUD_SUFFIXES)
    if hint := conversion_hint(suffix):
        return HTTPException(
            415, f"unknown file format {suffix.lstrip('.')}; expected one of {formats}; {hint}"
        )
    return HTTPException(415, f"unknown file format: give the parameter format, one of {formats}")


def suffix_of_type(content_type: str) -> str | None:
    """Return the suffix that stands for a media type, such as `.csv` for `text/csv`, or None."""
    subtype = content_type.partition(";")[0].rpartition("/")[2].strip().lower().removeprefix("x-")
    suffix = _SUFFIX_OF_SUBTYPE.get(subtype, f".{subtype}")
    return suffix if suffix in CLOUD_SUFFIXES else None


def read_body(body: bytes, headers: Mapping[str, str], max_bytes: int) -> Upload:
    """Return the file in the body of a request, unpacked.

    Args:
        body: body as sent.
        headers: headers of the request.
        max_bytes: size of the unpacked file.

    Raises:
        HTTPException: 400 a form without one file, 413 larger than `max_bytes`, 415 packed in another way.
        CloudReadError: damaged gzip data.
    """
    encodings = [name.strip().lower() for name in headers.get("content-encoding", "").split(",")]
    for encoding in reversed(encodings):
        if encoding in ("gzip", "x-gzip"):
            body = _unpacked(body, max_bytes)
        elif encoding not in ("", "identity"):
            raise HTTPException(415, f"unknown Content-Encoding {encoding!r}; expected gzip")
    content_type = headers.get("content-type", "")
    upload = Upload(body, "", content_type)
    if content_type.lower().startswith(_FORM):
        upload = _file_of_form(body, content_type)
    return upload._replace(content=_unpacked(upload.content, max_bytes))


def _unpacked(content: bytes, max_bytes: int) -> bytes:
    content = unpack_at_most(content, max_bytes + 1)
    if len(content) > max_bytes:
        raise HTTPException(413, f"the unpacked file is larger than {max_bytes / 2**20:g} MiB")
    return content


def _file_of_form(body: bytes, content_type: str) -> Upload:
    """Return the only part of a form (RFC 7578); parameters in a form are refused, so that none is overlooked."""
    parts = _parts(body, content_type)
    others = [name for name, upload in parts if not upload.name and len(parts) > 1]
    if others:
        raise HTTPException(400, f"{', '.join(others)[:200]}: give parameters in the URL, not in the form")
    if len(parts) != 1:
        raise HTTPException(400, f"the form holds {len(parts)} files; expected one")
    return parts[0][1]


def _parts(body: bytes, content_type: str) -> list[tuple[str, Upload]]:
    """Return the name and content of each part of a form."""
    head = Message()
    head["content-type"] = content_type
    boundary = head.get_param("boundary")
    if not isinstance(boundary, str) or not boundary.isascii():
        raise HTTPException(400, "the form has no boundary")
    mark = b"\r\n--" + boundary.encode()
    parts: list[tuple[str, Upload]] = []
    start = 0 if body.startswith(mark[2:]) else body.find(mark) + 2  # -1 + 2: found nowhere
    while start != 1 and len(parts) <= _MAX_PARTS:
        start += len(mark) - 2
        if body.startswith(b"--", start):
            return parts
        content = body.find(b"\r\n\r\n", start, start + _MAX_PART_HEADER) + 4
        end = body.find(mark, content - 2)
        if content < 4 or end < 0:
            break
        header = BytesHeaderParser().parsebytes(body[start + 2 : content])
        name = header.get_param("name", "", "content-disposition")
        upload = Upload(body[content:end], header.get_filename() or "", header.get("content-type", ""))
        parts.append((str(name), upload))
        start = end + 2
    raise HTTPException(400, "the form is damaged or has too many parts")
