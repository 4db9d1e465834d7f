# SPDX-License-Identifier: Apache-2.0
"""Predictions over HTTP."""
