# SPDX-License-Identifier: Apache-2.0
"""Every code has a sentence, and every surface words suggestions itself."""

from __future__ import annotations

from typing import get_args

import pytest

from doorstate.errors import CloudContentError, TooFewPointsError
from doorstate.inference.abstention import SENTENCES, Abstention, AbstentionCode

WITH_MESSAGE = {"no_rule_result", "unusable_cloud", "damaged_message"}


def test_every_code_has_a_sentence_or_a_message() -> None:
    assert set(SENTENCES) | WITH_MESSAGE == set(get_args(AbstentionCode))


@pytest.mark.parametrize(
    ("error", "code"),
    [(TooFewPointsError("few"), "too_few_points"), (CloudContentError("mm"), "unusable_cloud")],
)
def test_an_error_becomes_a_reason_in_the_words_of_the_surface(error: CloudContentError, code: str) -> None:
    error.suggestions = {"units_m": 0.001}
    abstention = Abstention.from_error(error)
    assert abstention.code == code
    assert abstention.describe(lambda name, value: "--units mm").endswith("--units mm")
    assert str(abstention) == str(error)


def test_values_are_in_the_sentence() -> None:
    abstention = Abstention("hole", {"share": 0.25, "free_reach_m": 4.0})
    assert "25%" in str(abstention)
    assert abstention == Abstention("hole", {"share": 0.25, "free_reach_m": 4.0})
