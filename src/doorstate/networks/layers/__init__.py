# SPDX-License-Identifier: Apache-2.0
"""Layers that several networks share; tensors are (B, ..., C), channels last, and a point is a row."""
