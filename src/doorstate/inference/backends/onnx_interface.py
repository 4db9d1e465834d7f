# SPDX-License-Identifier: Apache-2.0
"""Input and outputs that a file for onnxruntime must have, and the check that it has them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import WeightsError, summarize_exception
from doorstate.types import Points

_ONNX_NAMES = {"tensor(float)": "float32", "tensor(int64)": "int64"}
_HINT = "export it again"


class TensorSpec(NamedTuple):
    """Type and shape of an array for a batch of clouds."""

    dtype: str
    shape: tuple[int | str, ...]  # after the batch; names stand for any size

    def __str__(self) -> str:
        return f"{self.dtype} of shape {('batch', *self.shape)}".replace("'", "")


class Interface(NamedTuple):
    """Input and outputs that a file has to have."""

    path: Path
    input_name: str
    num_points: int | None  # that the file takes; None: any number
    outputs: Mapping[str, TensorSpec]

    def check(self, session: Any) -> None:
        """Check the inputs, and names and types of the outputs.

        Args:
            session: onnxruntime session of the file.

        Raises:
            WeightsError: they are others.
        """
        inputs = session.get_inputs()
        names = [node.name for node in inputs]
        if names != [self.input_name]:
            raise self._error(f"takes {', '.join(names)}", self.input_name, f"{self.input_name} alone")
        (given,) = inputs
        sizes = [size if isinstance(size, int) else None for size in given.shape]
        fits = (
            len(sizes) == 3
            and sizes[0] is None
            and sizes[1] in (None, self.num_points)
            and sizes[2] in (None, 3)
        )
        if not fits or _ONNX_NAMES.get(given.type) != "float32":
            expected = TensorSpec("float32", (self.num_points or "points", 3))
            raise self._error(
                f"takes {given.type} of shape {tuple(given.shape)}", self.input_name, str(expected)
            )
        types = {node.name: _ONNX_NAMES.get(node.type, node.type) for node in session.get_outputs()}
        for name, spec in self.outputs.items():
            if name not in types:
                raise self._error("has no such output", name)
            if types[name] != spec.dtype:
                raise self._error(f"gives {types[name]}", name, spec.dtype)

    def run(self, session: Any, points: Points) -> dict[str, NDArray[Any]]:
        """Return the outputs for points (B, n, 3) by name.

        Raises:
            WeightsError: the graph fails, or an output has another shape.
        """
        try:
            arrays = session.run(list(self.outputs), {self.input_name: points})
        except Exception as error:  # onnxruntime's errors have no common class of their own
            raise self._error(f"cannot be run ({summarize_exception(error)})") from error
        for (name, spec), array in zip(self.outputs.items(), arrays, strict=True):
            if not isinstance(array, np.ndarray) or array.shape != (len(points), *spec.shape):
                raise self._error(f"gives shape {np.shape(array)}", name, str(spec))
        return dict(zip(self.outputs, arrays, strict=True))

    def _error(self, message: str, field: str | None = None, expected: str | None = None) -> WeightsError:
        return WeightsError(message, path=self.path, field=field, expected=expected, hint=_HINT)
