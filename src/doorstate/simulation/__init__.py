# SPDX-License-Identifier: Apache-2.0
"""Door, room and camera drawn from a seed, rendered to clouds and a manifest that replays them."""
