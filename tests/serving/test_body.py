# SPDX-License-Identifier: Apache-2.0
"""Bodies of requests: packed by gzip, or a file in a form as curl, browsers and httpx send it."""

from __future__ import annotations

import gzip
import tracemalloc

import httpx
import pytest
from fastapi import HTTPException
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.errors import CloudReadError
from doorstate.serving.body import Upload, read_body
from tests.serving.helpers import CLOUD, NPY, error_of

_LIMIT = 10_000
_ROWS = "\n".join(" ".join(map(str, row)) for row in CLOUD.tolist()).encode()


def _form(
    files: dict[str, tuple[str | None, bytes, str]], data: dict[str, str] | None = None
) -> httpx.Request:
    request = httpx.Request("POST", "http://test", files=files, data=data)
    request.read()
    return request


def _status(body: bytes, headers: dict[str, str]) -> int:
    with pytest.raises(HTTPException) as caught:
        read_body(body, headers, _LIMIT)
    return caught.value.status_code


@given(
    st.binary(max_size=200).filter(lambda content: content[:2] != b"\x1f\x8b"),  # files of gzip are unpacked
    st.text(st.characters(codec="utf-8", exclude_categories=["C"], exclude_characters="/\\"), max_size=20),
)
@settings(max_examples=100)
def test_forms_of_httpx_are_read(content: bytes, stem: str) -> None:
    request = _form({"cloud": (f"a{stem}.csv", content, "text/plain")})
    for packed in (request.content, gzip.compress(request.content)):
        headers = {"content-type": request.headers["content-type"]}
        if packed is not request.content:
            headers["content-encoding"] = "gzip"
        upload = read_body(packed, headers, _LIMIT)
        assert upload.content == content
        assert upload.suffix == ".csv"


@given(st.binary(max_size=300))
@settings(max_examples=100)
def test_any_bytes_are_a_form_or_refused(body: bytes) -> None:
    with pytest.raises(HTTPException) as caught:
        read_body(body, {"content-type": "multipart/form-data; boundary=x"}, _LIMIT)
    assert caught.value.status_code == 400


@pytest.mark.parametrize(
    ("name", "content_type", "content", "suffix"),
    [
        ("a.pcd.GZ", "image/png", b"", ".pcd"),
        ("a", "text/csv; charset=utf-8", b"", ".csv"),
        ("a.unknown", "application/octet-stream", NPY, ".npy"),
        ("", "", b"\x89PNG\r\n\x1a\n", ".png"),
    ],
)
def test_format_by_name_then_type_then_content(
    name: str, content_type: str, content: bytes, suffix: str
) -> None:
    assert Upload(content, name, content_type).suffix == suffix


def test_a_format_that_nothing_tells_is_refused() -> None:
    with pytest.raises(HTTPException) as caught:
        _ = Upload(b"1 2 3", "cloud", "application/octet-stream").suffix
    assert caught.value.status_code == 415


def test_bodies_that_are_refused() -> None:
    two = _form({"a": ("a.npy", b"1", "x/y"), "b": ("b.npy", b"2", "x/y")})
    assert _status(two.content, dict(two.headers)) == 400
    parameters = _form({"a": ("a.npy", b"1", "x/y")}, {"axes": "optical"})
    assert _status(parameters.content, dict(parameters.headers)) == 400
    many = _form({str(i): ("a.npy", b"1", "x/y") for i in range(100)})
    assert _status(many.content, dict(many.headers)) == 400
    one = _form({"a": ("a.npy", b"1", "x/y")})
    assert _status(one.content[:-10], dict(one.headers)) == 400
    assert _status(one.content, {"content-type": "multipart/form-data"}) == 400
    assert _status(b"", {"content-type": "multipart/form-data; boundary=x"}) == 400
    assert _status(b"1 2 3", {"content-encoding": "br"}) == 415
    with pytest.raises(CloudReadError):
        read_body(gzip.compress(NPY)[:-20], {"content-encoding": "gzip"}, _LIMIT)


def test_memory_of_a_packed_body_is_bounded() -> None:
    bomb = gzip.compress(bytes(64 << 20))
    form = _form({"a": ("a.npy", bomb, "x/y")})
    tracemalloc.start()
    try:
        assert _status(bomb, {"content-encoding": "gzip"}) == 413
        assert _status(gzip.compress(bomb), {"content-encoding": "gzip, gzip"}) == 413
        assert _status(bomb, {}) == 413
        assert _status(form.content, dict(form.headers)) == 413
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak_bytes < 20 * _LIMIT + 2 * len(form.content)


def test_the_service_reads_forms_and_packed_bodies(client: httpx.Client) -> None:
    expected = client.post("/predict?format=npy", content=NPY).raise_for_status().json()["probabilities"]
    packed = {"content-encoding": "gzip"}
    for response in (
        client.post("/predict", files={"file": ("cloud.npy", NPY)}),
        client.post("/predict", files={"file": ("cloud", NPY)}),
        client.post("/predict", files={"file": ("cloud.xyz", _ROWS)}),
        client.post("/predict?format=npy", files={"file": ("cloud.bin", NPY)}),
        client.post("/predict?format=npy", content=gzip.compress(NPY), headers=packed),
        client.post("/predict", content=gzip.compress(NPY)),
        client.post("/predict?filename=a.xyz.gz", content=gzip.compress(_ROWS)),
    ):
        assert response.raise_for_status().json()["probabilities"] == expected
    error_of(client.post("/predict", files={"file": ("cloud.las", b"LASF")}), 415)
    error_of(client.post("/predict?format=npy", content=gzip.compress(bytes(1 << 20)), headers=packed), 413)
    error_of(client.post("/predict?format=npy", files={"file": NPY}, data={"axes": "optical"}), 400)


def test_a_format_that_can_be_converted_is_named_with_the_conversion() -> None:
    with pytest.raises(HTTPException) as caught:
        Upload(b"LASF", "scan.las", "").suffix  # noqa: B018
    assert caught.value.status_code == 415
    assert "laspy" in caught.value.detail
