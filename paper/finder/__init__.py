# SPDX-License-Identifier: Apache-2.0
"""Training of the column scorer of `doorstate.doorways`: walls of simulated frames, network, export to ONNX."""
