# SPDX-License-Identifier: Apache-2.0
"""Libraries that run a network: torch, and onnxruntime for exported files. Importing this package imports neither."""

from __future__ import annotations

from doorstate.inference.backends.base import Backend, CloudOutputs, Outputs, run_by_size
from doorstate.inference.backends.loading import load_backend, needs_torch

__all__ = ["Backend", "CloudOutputs", "Outputs", "load_backend", "needs_torch", "run_by_size"]
