# SPDX-License-Identifier: Apache-2.0
"""Random scenes, viewpoints and openings, drawn from the ranges of the data card."""
