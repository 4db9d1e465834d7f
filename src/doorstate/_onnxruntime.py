# SPDX-License-Identifier: Apache-2.0
"""Sessions of onnxruntime, without its telemetry."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from onnxruntime import InferenceSession, SessionOptions


def open_session(content: bytes, options: SessionOptions) -> InferenceSession:
    """Return a session of a graph on the processor.

    Builds of onnxruntime for Windows report their use to Microsoft unless they are told not to, as is done here.
    Source: https://github.com/microsoft/onnxruntime/blob/main/docs/Privacy.md

    Args:
        content: file of the graph.
        options: options of the session.

    Raises:
        Exception: the graph cannot be used; onnxruntime's errors have no common class of their own.
    """
    import onnxruntime  # takes a tenth of a second

    onnxruntime.disable_telemetry_events()
    return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
