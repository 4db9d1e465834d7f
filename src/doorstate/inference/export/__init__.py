# SPDX-License-Identifier: Apache-2.0
"""Export of a network to ONNX: metres in, probabilities out, compared with torch before the file is written."""

from doorstate.inference.export.packages import OPSET, check_export_packages

check_export_packages()

from doorstate.inference.export.onnx_file import export_onnx  # noqa: E402
from doorstate.inference.export.parity import TOLERANCE, Parity  # noqa: E402
from doorstate.inference.export.weights_graph import weights_graph, write_weights_graph  # noqa: E402

__all__ = [
    "OPSET",
    "TOLERANCE",
    "Parity",
    "check_export_packages",
    "export_onnx",
    "weights_graph",
    "write_weights_graph",
]
