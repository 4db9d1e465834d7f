# SPDX-License-Identifier: Apache-2.0
"""Listening socket of the service."""

from __future__ import annotations

import socket

from doorstate.serving.server import listen


def test_connections_do_not_delay_small_packets() -> None:
    with listen("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        accepted, _ = listener.accept()
        with accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
