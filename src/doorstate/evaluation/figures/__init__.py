# SPDX-License-Identifier: Apache-2.0
"""Figures of comparisons, data sets and studies, drawn without global state."""
