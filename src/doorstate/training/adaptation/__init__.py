# SPDX-License-Identifier: Apache-2.0
"""Adaptation of weights to the doors of one place: its labelled frames mixed with simulated ones."""
