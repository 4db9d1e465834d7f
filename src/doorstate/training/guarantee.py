# SPDX-License-Identifier: Apache-2.0
"""Least probability of an answer with a guaranteed share of wrong answers: Learn then Test (Angelopoulos et al. 2021).

Each threshold has the null hypothesis that more than the allowed share of its answers is wrong. Samples of one scene
depend on each other, so one of each scene counts: the wrong ones among the answers of a fixed threshold are then
binomial, and their exact tail is a p-value. Thresholds are tested from strict to lenient, from several fixed starts
that share the allowed error, each until a threshold fails. That any threshold that passes has more wrong answers than
allowed then has a probability of at most one minus the confidence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from doorstate.networks.card import Guarantee
from doorstate.types import Indices

CONFIDENCE = 0.9
STARTS = (0.97, 0.9)  # each further one asks for more scenes
# Fixed before any sample is seen, as the proof demands. A state has at least one third.
_THRESHOLDS = tuple(round(0.01 * percent, 2) for percent in range(99, 33, -1))


def guaranteed_threshold(
    confidence: NDArray[np.float64],
    correct: NDArray[np.bool_],
    wrong_share: float,
    with_confidence: float = CONFIDENCE,
) -> tuple[float, Guarantee] | None:
    """Return the lowest threshold whose share of wrong answers is guaranteed, and the guarantee.

    Args:
        confidence: (M,) probability of the predicted state, one sample a scene; 0 where no threshold answers.
        correct: (M,) True for right predictions.
        wrong_share: largest share of wrong ones among answers in scenes drawn as these.
        with_confidence: probability, over the draw of the scenes, that the guarantee holds.

    Returns:
        None where no threshold passes: too few scenes, or too many errors.
    """
    allowed = (1 - with_confidence) / len(STARTS)
    passed = [
        threshold
        for start in STARTS
        for threshold in _passing(start, confidence, correct, wrong_share, allowed)
    ]
    if not passed:
        return None
    threshold = min(passed)
    answered = confidence >= threshold
    return threshold, Guarantee(
        wrong_share=wrong_share,
        confidence=with_confidence,
        scenes=len(confidence),
        answered=int(answered.sum()),
        wrong=int((answered & ~correct).sum()),
    )


def p_value(answered: int, wrong: int, wrong_share: float) -> float:
    """Return the largest probability of as few wrong answers if more than the allowed share is wrong."""
    return float(binom.cdf(wrong, answered, wrong_share))


def one_sample_a_scene(scenes: Sequence[str], seed: int) -> Indices:
    """Return the row number of one random sample of each scene, ascending.

    Args:
        scenes: names of the samples' scenes.
        seed: seed of the choice.
    """
    shuffled = np.random.default_rng(seed).permutation(len(scenes))
    _, first = np.unique(np.asarray(scenes, dtype=object)[shuffled], return_index=True)
    return np.sort(shuffled[first])


def _passing(
    start: float,
    confidence: NDArray[np.float64],
    correct: NDArray[np.bool_],
    wrong_share: float,
    allowed: float,
) -> list[float]:
    """Return the thresholds from a start downwards that pass before the first that fails."""
    passing = []
    for threshold in _THRESHOLDS[_THRESHOLDS.index(start) :]:
        answered = confidence >= threshold
        if p_value(int(answered.sum()), int((answered & ~correct).sum()), wrong_share) > allowed:
            break
        passing.append(threshold)
    return passing
