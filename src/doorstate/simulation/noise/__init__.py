# SPDX-License-Identifier: Apache-2.0
"""Noise models of depth sensors, built of pure stages from depth to depth.

`sensors.find_sensor(name)` returns a model, `model.sense(model, rendered, boxes, pose, camera, seed)` its measurement
of a rendering, and `streams.sample_seed(row.seed, row.sample_id)` the seed of a sample.
"""
