# SPDX-License-Identifier: Apache-2.0
"""From any file to points in progressive order: one path for training, export and robot."""
