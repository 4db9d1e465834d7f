# SPDX-License-Identifier: Apache-2.0
"""Packages and weights that are installed, for `doorstate info` and reports of problems; imports no large package."""

from __future__ import annotations

import platform
import re
from importlib import metadata

from doorstate import __version__

_FOR_DEVELOPERS = {"dev", "docs", "fuzz"}
_REQUIREMENT = re.compile(r"([\w.-]+)[^;]*;.*\bextra\s*==\s*['\"]([\w-]+)['\"]")


def describe_installation() -> dict[str, str | int | None]:
    """Return versions and the machine; None is a package that is not installed."""
    from doorstate._environment import processor_name
    from doorstate._jobs import default_workers
    from doorstate.clouds.samplers import choose_sampler
    from doorstate.inference.backends.threads import default_threads

    return {
        "doorstate": __version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processor": processor_name(),
        "processors": default_workers(),
        "threads": default_threads(),
        "sampling": choose_sampler().library,
        **{name: version_of(name) for name in ("onnxruntime", "torch", "numpy")},
    }


def missing_by_extra() -> dict[str, list[str]]:
    """Return the packages that are not installed, by optional extra of this package."""
    missing: dict[str, list[str]] = {}
    for requirement in _requirements():
        if (match := _REQUIREMENT.match(requirement)) and match[2] not in _FOR_DEVELOPERS:
            packages = missing.setdefault(match[2], [])
            if version_of(match[1]) is None and match[1] not in packages:
                packages.append(match[1])
    return missing


def version_of(package: str) -> str | None:
    """Return the version of an installed package."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _requirements() -> list[str]:
    try:
        return metadata.requires("doorstate") or []
    except metadata.PackageNotFoundError:  # run from its source folder
        return []
