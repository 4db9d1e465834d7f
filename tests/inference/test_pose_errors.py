# SPDX-License-Identifier: Apache-2.0
"""A candidate and a network are combined as two measurements are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.doorways.candidate_errors import candidate_errors
from doorstate.inference.pose_errors import Correction, weigh_correction
from doorstate.networks.card import HeadErrors

NETWORK = HeadErrors(along_m=0.05, across_m=0.03, yaw_deg=0.8, width_m=0.1)
_CENTIMETRES = st.floats(-0.02, 0.02)


def test_without_errors_of_the_network_its_correction_counts_in_full() -> None:
    correction = Correction(0.3, -0.1, 4.0, 0.2)
    assert weigh_correction(correction, 0.5, None) == (correction, candidate_errors(0.5))


@given(score=st.floats(0, 1), along_m=_CENTIMETRES, across_m=_CENTIMETRES)
def test_the_combination_has_the_least_variance(score: float, along_m: float, across_m: float) -> None:
    candidate = candidate_errors(score)
    correction, errors = weigh_correction(Correction(along_m, across_m, 0.0, 0.0), score, NETWORK)
    for value, part, own, of_candidate, left in zip(
        (along_m, across_m), correction, (NETWORK.along_m, NETWORK.across_m), candidate, errors, strict=False
    ):
        weight = np.linspace(0, 1, 10_001)
        variance = (1 - weight) ** 2 * of_candidate**2 + weight**2 * own**2
        best = int(variance.argmin())
        assert part == pytest.approx(weight[best] * value, abs=1e-4 * abs(value) + 1e-12)
        assert left >= float(np.sqrt(variance[best])) * (1 - 1e-6)


def test_a_correction_that_nothing_explains_makes_the_errors_larger() -> None:
    usual = weigh_correction(Correction(0.01, 0.0, 0.0, 0.0), 0.9, NETWORK).errors
    large = weigh_correction(Correction(0.5, 0.0, 0.0, 0.0), 0.9, NETWORK).errors
    assert large.along_m > 4 * usual.along_m


def test_sure_candidates_err_less() -> None:
    assert candidate_errors(0.9).along_m < candidate_errors(0.6).along_m < candidate_errors(0.2).along_m
    assert candidate_errors(0.0) == candidate_errors(0.05)
