# SPDX-License-Identifier: Apache-2.0
"""The live page's server: one page, events for whoever listens, and nobody from elsewhere."""

from __future__ import annotations

import http.client
import json
from typing import Any
from urllib.parse import urlsplit

import pytest

from doorstate.errors import ConfigError
from doorstate.viewer.live_page import LivePage


def ask(page: LivePage, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(urlsplit(page.address).netloc, timeout=10)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


def read_event(answer: http.client.HTTPResponse) -> tuple[int, str, Any]:
    """Number, kind and content of the next event, past comments."""
    fields: dict[str, str] = {}
    while line := answer.readline().decode().rstrip("\n"):
        name, _, value = line.partition(": ")
        fields[name] = value
    return (
        (int(fields["id"]), fields["event"], json.loads(fields["data"]))
        if "id" in fields
        else read_event(answer)
    )


def test_the_page_is_served_and_nothing_else() -> None:
    with LivePage("<p>ö</p>") as page:
        answer = ask(page, "/")
        assert (answer.status, answer.read().decode()) == (200, "<p>ö</p>")
        assert answer.headers["Content-Type"] == "text/html; charset=utf-8"
        assert ask(page, "/etc/passwd").status == 404
        assert ask(page, "/", Host="door.example:80").status == 403
        assert ask(page, "/events", Host="door.example").status == 403
        assert ask(page, "/", Host="localhost:1").status == 200


def test_everybody_gets_every_event_also_those_before_they_came() -> None:
    with LivePage("") as page:
        page.publish("cloud", {"name": "a"})
        early = ask(page, "/events")
        assert early.headers["Content-Type"] == "text/event-stream"
        first = read_event(early)
        assert first[1:] == ("cloud", {"name": "a"})
        page.publish("cloud", {"name": "b\n</script>"})
        page.publish("end", None)
        late = ask(page, "/events")
        seen = [[read_event(answer)[1:] for _ in range(n)] for answer, n in ((early, 2), (late, 3))]
        assert seen[1][1:] == seen[0] == [("cloud", {"name": "b\n</script>"}), ("end", None)]
        again = ask(page, "/events", **{"Last-Event-ID": str(first[0])})
        assert read_event(again)[2] == {"name": "b\n</script>"}, "a browser that lost the connection goes on"


def test_a_browser_that_knew_an_earlier_server_gets_all() -> None:
    with LivePage("") as page:
        page.publish("cloud", 1)
        number, _, _ = read_event(ask(page, "/events"))
    with LivePage("") as page:
        page.publish("cloud", 2)
        assert read_event(ask(page, "/events", **{"Last-Event-ID": str(number)}))[2] == 2


def test_old_events_are_forgotten_and_a_browser_that_left_is_no_error() -> None:
    with LivePage("") as page:
        ask(page, "/events").close()
        for number in range(150):
            page.publish("cloud", number)
        assert read_event(ask(page, "/events"))[2] == 50


def test_the_end_closes_streams_and_frees_the_port() -> None:
    with LivePage("") as page:
        listening = ask(page, "/events")
        port = urlsplit(page.address).port
        with pytest.raises(ConfigError, match=rf"--port {port}: .*in use"):
            LivePage("", port or 0)
    assert listening.read() in (b"", b": still here\n\n")
    with LivePage("", port or 0) as page:
        assert urlsplit(page.address).port == port
