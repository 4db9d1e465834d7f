# SPDX-License-Identifier: Apache-2.0
"""Server of the live page: one page, its events, and local clients only."""

from __future__ import annotations

import http.client
import json
from typing import Any
from urllib.parse import urlsplit

import pytest

from doorstate.errors import ConfigError
from doorstate.viewer.live_page import LivePage


def get(page: LivePage, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(urlsplit(page.address).netloc, timeout=60)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


def read_event(response: http.client.HTTPResponse) -> tuple[int, str, Any]:
    """Return number, kind and content of the next event, skipping comments."""
    fields: dict[str, str] = {}
    while line := response.readline().decode().rstrip("\n"):
        name, _, value = line.partition(": ")
        fields[name] = value
    return (
        (int(fields["id"]), fields["event"], json.loads(fields["data"]))
        if "id" in fields
        else read_event(response)
    )


def test_only_the_page_is_served_to_local_clients() -> None:
    with LivePage("<p>ö</p>") as page:
        response = get(page, "/")
        assert (response.status, response.read().decode()) == (200, "<p>ö</p>")
        assert response.headers["Content-Type"] == "text/html; charset=utf-8"
        assert get(page, "/etc/passwd").status == 404
        assert get(page, "/", Host="door.example:80").status == 403
        assert get(page, "/events", Host="door.example").status == 403
        assert get(page, "/", Host="localhost:1").status == 200


def test_every_client_gets_all_events() -> None:
    with LivePage("") as page:
        page.publish("cloud", {"name": "a"})
        early = get(page, "/events")
        assert early.headers["Content-Type"] == "text/event-stream"
        first = read_event(early)
        assert first[1:] == ("cloud", {"name": "a"})
        page.publish("cloud", {"name": "b\n</script>"})
        page.publish("end", None)
        late = get(page, "/events")
        received = [[read_event(response)[1:] for _ in range(n)] for response, n in ((early, 2), (late, 3))]
        assert received[1][1:] == received[0] == [("cloud", {"name": "b\n</script>"}), ("end", None)]
        reconnected = get(page, "/events", **{"Last-Event-ID": str(first[0])})
        assert read_event(reconnected)[2] == {"name": "b\n</script>"}


def test_client_of_an_earlier_server_gets_all_events() -> None:
    with LivePage("") as page:
        page.publish("cloud", 1)
        number, _, _ = read_event(get(page, "/events"))
    with LivePage("") as page:
        page.publish("cloud", 2)
        assert read_event(get(page, "/events", **{"Last-Event-ID": str(number)}))[2] == 2


def test_only_the_last_hundred_events_are_kept() -> None:
    with LivePage("") as page:
        get(page, "/events").close()
        for number in range(150):
            page.publish("cloud", number)
        assert read_event(get(page, "/events"))[2] == 50


def test_closing_ends_streams_and_frees_the_port() -> None:
    with LivePage("") as page:
        listening = get(page, "/events")
        port = urlsplit(page.address).port
        with pytest.raises(ConfigError) as raised:
            LivePage("", port or 0)
        assert raised.value.field == "port"
    assert listening.read() in (b"", b": keep-alive\n\n")
    with LivePage("", port or 0) as page:
        assert urlsplit(page.address).port == port
