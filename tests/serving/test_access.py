# SPDX-License-Identifier: Apache-2.0
"""Host names, tokens and security headers."""

from __future__ import annotations

import socket

import httpx
import pytest

from doorstate.errors import ConfigError
from doorstate.serving.access import Access
from tests.serving.helpers import NPY, error_of, serving


@pytest.mark.parametrize(
    ("host", "allowed"),
    [
        ("localhost", True),
        ("LOCALHOST:8000", True),
        ("127.0.0.1:8000", True),
        ("[::1]:8000", True),
        ("[::1", False),
        ("192.168.1.7", True),
        (f"{socket.gethostname()}:80", True),
        ("robot.local:8000", True),
        ("evil.example", False),
        ("localhost.evil.example", False),
        ("", False),
        ("evil.example:8000", False),
    ],
)
def test_hosts(host: str, allowed: bool) -> None:
    assert Access(("Robot.local",)).allows_host(host) is allowed


@pytest.mark.parametrize(
    ("header", "allowed"),
    [
        ("Bearer secret", True),
        ("bearer secret", True),
        ("Bearer other", False),
        ("Basic secret", False),
        ("", False),
    ],
)
def test_tokens(header: str, allowed: bool) -> None:
    assert Access(token="secret").allows_token(header) is allowed
    assert Access().allows_token(header)


@pytest.mark.parametrize("token", ["", " ", "a b", "a\n", "é"])
def test_tokens_that_protect_nothing_are_refused(token: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Access(token=token)
    assert caught.value.field == "token"


def test_foreign_host_is_refused(client: httpx.Client) -> None:
    error_of(client.get("/health", headers={"host": "evil.example"}), 421)
    error_of(client.post("/predict?format=npy", content=NPY, headers={"host": "evil.example"}), 421)


def test_token_is_needed_but_for_health() -> None:
    with serving(access=Access(token="secret")) as client:
        refused = client.post("/predict?format=npy", content=NPY)
        error_of(refused, 401)
        assert refused.headers["www-authenticate"].startswith("Bearer")
        assert client.get("/metrics").status_code == 401
        assert client.get("/health").status_code == 200
        headers = {"authorization": "Bearer secret"}
        assert client.post("/predict?format=npy", content=NPY, headers=headers).status_code == 200


@pytest.mark.parametrize("path", ["/", "/health", "/docs", "/metrics", "/nowhere"])
def test_every_response_has_security_headers(client: httpx.Client, path: str) -> None:
    headers = client.get(path).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["content-security-policy"].startswith("default-src 'none'")
    assert "unsafe-eval" not in headers["content-security-policy"]
    assert headers["cache-control"] == "no-store"
