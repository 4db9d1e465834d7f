# SPDX-License-Identifier: Apache-2.0
"""Sensors that measure the time of flight of modulated light."""
