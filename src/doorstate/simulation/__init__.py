# SPDX-License-Identifier: Apache-2.0
"""Simulated depth images of doors, from a seed to a manifest that renders each of them again.

In order: `scene` (door, rooms and clutter as boxes), `draw` (random scenes), `presets` (recipes for manifest rows),
`camera` and `render` (depth images), `noise` (sensor models), `frames` (replay of rows), `generate` (rows with their
images), `manifest` and `writer` (files).
"""
