# SPDX-License-Identifier: Apache-2.0
"""Inputs and outputs of a file for onnxruntime: one that has others is refused, and so are arrays of another form."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import WeightsError, summarize_exception
from doorstate.types import Points

_ONNX_NAMES = {"tensor(float)": "float32", "tensor(int64)": "int64"}
_AGAIN = "export it again"


class Form(NamedTuple):
    """Form of an array of a batch."""

    dtype: str
    shape: tuple[int, ...]  # after the batch

    def __str__(self) -> str:
        return f"{self.dtype} of shape {('batch', *self.shape)}".replace("'", "")


class Interface(NamedTuple):
    """Input and outputs that a file has to have."""

    path: Path
    input_name: str
    num_points: int | None  # that the file takes; None: any number
    outputs: Mapping[str, Form]

    def check(self, session: Any) -> None:
        """Check the inputs, and names and types of the outputs.

        Args:
            session: onnxruntime session of the file.

        Raises:
            WeightsError: they are others.
        """
        names = [node.name for node in session.get_inputs()]
        if names != [self.input_name]:
            raise self._error(f"takes {', '.join(names)}", self.input_name, f"{self.input_name} alone")
        (given,) = session.get_inputs()
        sizes = [size if isinstance(size, int) else None for size in given.shape]
        fits = (
            len(sizes) == 3
            and sizes[0] is None
            and sizes[1] in (None, self.num_points)
            and sizes[2] in (None, 3)
        )
        if not fits or _ONNX_NAMES.get(given.type) != "float32":
            expected = str(Form("float32", (self.num_points or -1, 3))).replace("-1", "points")
            raise self._error(f"takes {given.type} of shape {tuple(given.shape)}", self.input_name, expected)
        types = {node.name: _ONNX_NAMES.get(node.type, node.type) for node in session.get_outputs()}
        for name, form in self.outputs.items():
            if name not in types:
                raise self._error("has no such output", name)
            if types[name] != form.dtype:
                raise self._error(f"gives {types[name]}", name, form.dtype)

    def run(self, session: Any, points: Points) -> dict[str, NDArray[Any]]:
        """Return the outputs for points (B, n, 3) by name.

        Raises:
            WeightsError: the graph fails, or an output has another form.
        """
        try:
            arrays = session.run(list(self.outputs), {self.input_name: points})
        except Exception as error:  # onnxruntime's errors have no common class of their own
            raise self._error(f"cannot be run ({summarize_exception(error)})") from error
        for (name, form), array in zip(self.outputs.items(), arrays, strict=True):
            if not isinstance(array, np.ndarray) or array.shape != (len(points), *form.shape):
                raise self._error(f"gives shape {np.shape(array)}", name, str(form))
        return dict(zip(self.outputs, arrays, strict=True))

    def _error(self, message: str, field: str | None = None, expected: str | None = None) -> WeightsError:
        return WeightsError(message, path=self.path, field=field, expected=expected, hint=_AGAIN)
