# SPDX-License-Identifier: Apache-2.0
"""Fixtures of comparisons, shared with the tests of evaluation."""

from tests.evaluation.conftest import make_comparison, simulated

__all__ = ["make_comparison", "simulated"]
