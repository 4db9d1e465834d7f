# SPDX-License-Identifier: Apache-2.0
"""Export of a network to ONNX: metres in, probabilities out, compared with torch before the file is written."""

from doorstate.inference.export.onnx_file import OPSET, check_export_packages, export_onnx
from doorstate.inference.export.parity import TOLERANCE, Parity

__all__ = ["OPSET", "TOLERANCE", "Parity", "check_export_packages", "export_onnx"]
