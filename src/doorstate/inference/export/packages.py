# SPDX-License-Identifier: Apache-2.0
"""Packages that write ONNX: whether they are installed, what they write and what they say meanwhile."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

from doorstate.errors import missing_extra

OPSET = 18  # torch's exporter writes it; newer ones are converted from it
_PACKAGES = ("onnx", "onnxscript", "onnxruntime")  # torch's exporter needs the second


def check_export_packages() -> None:
    """Check that the packages for an export are installed.

    Raises:
        MissingExtraError: one of them is not.
    """
    try:
        for package in _PACKAGES:
            import_module(package)
    except ImportError as error:
        raise missing_extra("export", *_PACKAGES) from error


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
