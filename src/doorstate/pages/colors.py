# SPDX-License-Identifier: Apache-2.0
"""Colours of states, detections and parts, and the oblique view of clouds, in every picture and page."""

from __future__ import annotations

import math

from doorstate.types import ABSTAINED, Part

STATE_WORDS = {"closed": "closed", "semi_open": "semi-open", "open": "open", ABSTAINED: "abstained"}
# Okabe & Ito's colour-blind-safe set.
STATE_COLORS = {"closed": "#0072B2", "semi_open": "#E69F00", "open": "#CC79A7"}
# Detections of rules and predicted doors, over clouds in the colours of their parts.
DETECTION_COLORS = {
    "wall": "#0072B2",
    "leaf": "#B3202C",
    "opening": "#00A651",
    "surface": "#B3202C",
    "edge": "#111111",
    "corner": "#111111",
    "door frame": "#00A651",
    "hinge": "#7B4FA3",
    "angle": "#B3202C",
    "swing": "#D98A8F",
    "refused": "#7C828C",
}
PART_COLORS = {
    Part.WALL: "#A9B1BC",
    Part.FRAME: "#7B4FA3",
    Part.LEAF: "#D55E00",
    Part.FLOOR: "#6C8EAD",
    Part.CEILING: "#C9CED6",
    Part.OTHER: "#009E73",
    Part.NONE: "#333333",
}

# The eye is right behind the camera, so that left and right are as in its picture, and above it.
VIEW_ELEVATION_RAD = math.radians(25.0)
