# SPDX-License-Identifier: Apache-2.0
"""Measurements behind tables of docs/benchmarks that are not about speed: `python -m paper.measurements --help`."""
