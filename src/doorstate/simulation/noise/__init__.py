# SPDX-License-Identifier: Apache-2.0
"""Models of depth sensors: what they measure of a rendered scene, as pure stages from depth to depth.

`models.find_sensor(name)` gives a model, `models.apply(model, seen, boxes, pose, camera, seed)` what it measures of a
rendering, cut to its range, and `streams.sample_seed(row.seed, row.sample_id)` a seed that is a sample's own.
"""
