# SPDX-License-Identifier: Apache-2.0
"""Experiments, published results and pages of the comparison: `python -m paper --help`, from the repository."""
