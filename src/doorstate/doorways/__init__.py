# SPDX-License-Identifier: Apache-2.0
"""Doorways of a level cloud: walls, candidate doorways on them, and the cloud around each in the doorway's frame."""
