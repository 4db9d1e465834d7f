# SPDX-License-Identifier: Apache-2.0
"""Preparation, sampling and augmentation of clouds."""
