# SPDX-License-Identifier: Apache-2.0
"""Doors with names: their list, their sightings by a camera whose pose is known, and the history of their states."""
