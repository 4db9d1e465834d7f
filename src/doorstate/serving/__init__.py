# SPDX-License-Identifier: Apache-2.0
"""Predictions over HTTP."""

from doorstate.errors import check_extra

check_extra("the HTTP service", "serve")
