# SPDX-License-Identifier: Apache-2.0
"""Linear layers of an ONNX graph with 8-bit integer weights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from onnx import ModelProto


def quantize_linear_layers(model: ModelProto, path: Path) -> ModelProto:
    """Return the graph with the matrices of linear layers as 8-bit integers.

    Args:
        model: float32 graph.
        path: file to work in, because the quantizer reads and writes files.
    """
    import onnx
    from onnxruntime.quantization import QuantType, quantize_dynamic

    onnx.save(model, path)
    quantize_dynamic(path, path, weight_type=QuantType.QInt8)
    return onnx.load(path)
