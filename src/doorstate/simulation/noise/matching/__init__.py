# SPDX-License-Identifier: Apache-2.0
"""Sensors that match windows of pixels between two views: structured light and stereo."""
