# SPDX-License-Identifier: Apache-2.0
"""Roles of samples in a fold."""

from __future__ import annotations

from typing import Literal

Role = Literal["train", "val", "test", "unused"]
ROLES: tuple[Role, ...] = ("train", "val", "test", "unused")
