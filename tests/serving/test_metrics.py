# SPDX-License-Identifier: Apache-2.0
"""Numbers for Prometheus."""

from __future__ import annotations

from prometheus_client.parser import text_string_to_metric_families

from tests.serving.helpers import NPY, serving


def test_requests_and_predictions_are_counted() -> None:
    with serving() as client:
        for _ in range(2):
            client.post("/predict?format=npy", content=NPY).raise_for_status()
        client.post("/predict?format=npy", content=b"")
        client.get("/nowhere")
        text = client.get("/metrics").raise_for_status().text
    values = {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    assert values["doorstate_requests_total", "/predict", "200"] == 2
    assert values["doorstate_requests_total", "/predict", "400"] == 1
    assert values["doorstate_requests_total", "other", "404"] == 1
    assert values["doorstate_predictions_total", "closed"] == 2
    assert values["doorstate_request_seconds_count", "/predict"] == 3
    assert values["doorstate_bytes_in_flight",] == 0
    assert values["doorstate_files",] == 0
