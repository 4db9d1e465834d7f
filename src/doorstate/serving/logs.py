# SPDX-License-Identifier: Apache-2.0
"""Log lines of the service and its workers."""

from __future__ import annotations

from typing import Any


def log_config(verbose: bool) -> dict[str, Any]:
    """Return the configuration of the loggers: lines with date and time on standard error."""
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "formatters": {
            "dated": {
                "format": "%(asctime)s.%(msecs)03d %(levelname)s %(message)s",
                "datefmt": "%Y-%m-%dT%H:%M:%S",
            }
        },
        "handlers": {
            "stderr": {"class": "logging.StreamHandler", "formatter": "dated", "stream": "ext://sys.stderr"}
        },
        "loggers": {
            name: {"handlers": ["stderr"], "level": "INFO" if verbose else "WARNING", "propagate": False}
            for name in ("uvicorn", "doorstate")
        },
    }
