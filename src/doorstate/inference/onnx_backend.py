# SPDX-License-Identifier: Apache-2.0
"""A file of `doorstate export` asked by onnxruntime; torch is not needed."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from doorstate.clouds.preparation import centroids
from doorstate.errors import WeightsError, missing_extra, summarize_exception
from doorstate.networks.card import WeightsCard
from doorstate.networks.heads import head_columns
from doorstate.networks.heads.spec import Columns
from doorstate.types import PARTS, STATES, Points

INPUT, OUTPUT = "points", "probabilities"
CARD = "doorstate"  # of the file's metadata
_ERRORS_ONLY = 3


class OnnxBackend:
    """An exported network; preparation but for sampling, and the temperature, are in its graph.

    Any number of threads may ask it.

    Args:
        path: the file.
        threads: for one answer; None takes what the environment's OMP_NUM_THREADS says, as torch does, and all
            processors if it says nothing.

    Raises:
        MissingExtraError: onnxruntime is not installed.
        WeightsError: the file is missing, damaged, or not of `doorstate export`.
    """

    card: WeightsCard
    """What the file says of itself; `num_points` is how many points it takes."""

    def __init__(self, path: Path, threads: int | None = None) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise missing_extra(path.name, "onnxruntime") from error
        if not path.is_file():
            raise WeightsError(f"{path}: no such weights file")
        options = onnxruntime.SessionOptions()
        options.log_severity_level = _ERRORS_ONLY
        options.intra_op_num_threads = _threads_by_environment() if threads is None else threads
        try:
            self._session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors have no common class of their own
            raise WeightsError(f"{path}: cannot be read as ONNX ({summarize_exception(error)})") from error
        try:
            self.card = WeightsCard.model_validate_json(
                self._session.get_modelmeta().custom_metadata_map[CARD]
            )
        except (KeyError, ValidationError) as error:
            raise WeightsError(
                f"{path}: not a file of `doorstate export`: its metadata lack {CARD}"
            ) from error
        if self.card.states != STATES:
            raise WeightsError(f"{path}: made for states {self.card.states}")
        self._heads = heads_told(self.card)

    def ask(self, points: Points) -> tuple[NDArray[np.float32], Columns]:
        """Probabilities (B, 3), and what further heads say, (B,) each, of (B, n, 3) metres in farthest-point order.

        Args:
            points: n is as many as the file was exported for.
        """
        answer, *heads = self._session.run([OUTPUT, *self._heads], {INPUT: points})
        return answer, head_columns(dict(zip(self._heads, heads, strict=True)), centroids(points))


def heads_told(card: WeightsCard) -> tuple[str, ...]:
    """Outputs of a file besides the probabilities: heads of whole clouds."""
    return tuple(name for name in card.heads if name != PARTS)


def _threads_by_environment() -> int:
    said = os.environ.get("OMP_NUM_THREADS", "")
    return int(said) if said.isdecimal() else 0
