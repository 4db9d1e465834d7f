# SPDX-License-Identifier: Apache-2.0
"""Packages that write ONNX: whether they are installed, what they write and what they say meanwhile."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from doorstate.errors import check_extra

OPSET = 18  # torch's exporter writes it; newer ones are converted from it


def check_export_packages() -> None:
    """Check that the packages for an export are installed.

    Raises:
        MissingExtraError: one of them is not.
    """
    check_extra("export", "onnx", "torch", "safetensors", "onnx", "onnxscript")


@contextmanager
def without_warnings() -> Iterator[None]:
    """Suppress warnings of torch's exporter and of the quantizer about their own internals and optional packages."""
    previous = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(previous)
