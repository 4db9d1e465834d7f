# SPDX-License-Identifier: Apache-2.0
"""Numbers about a service in the text format of Prometheus."""

from __future__ import annotations

import time

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.types import ASGIApp, Message, Receive, Scope, Send

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_SECONDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30)
_PATHS = {"/", "/predict", "/health", "/metrics", "/docs", "/openapi.json"}


class Metrics:
    """Counters of one service."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "doorstate_requests", "Responses by path and status.", ("path", "status"), registry=self.registry
        )
        self.predictions = Counter(
            "doorstate_predictions",
            "Predictions by state; abstained where there is none.",
            ("state",),
            registry=self.registry,
        )
        self.seconds = Histogram(
            "doorstate_request_seconds",
            "Time from the head of a request to the end of its response.",
            ("path",),
            buckets=_SECONDS,
            registry=self.registry,
        )
        self.waiting = Gauge(
            "doorstate_files", "Files that wait for a worker or are processed.", registry=self.registry
        )
        self.bytes_in_flight = Gauge(
            "doorstate_bytes_in_flight",
            "Received bytes of files that are not answered.",
            registry=self.registry,
        )

    def text(self) -> bytes:
        """Return all numbers."""
        return generate_latest(self.registry)


class CountRequests:
    """ASGI middleware: count every response, and measure its time."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started, status = time.perf_counter(), 500

        async def send_and_note(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        path = scope["path"] if scope["path"] in _PATHS else "other"
        try:
            await self._app(scope, receive, send_and_note)
        finally:
            self._metrics.requests.labels(path, status).inc()
            self._metrics.seconds.labels(path).observe(time.perf_counter() - started)
