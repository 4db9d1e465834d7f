# SPDX-License-Identifier: Apache-2.0
"""Random walls without a door."""

from __future__ import annotations

from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.feature import FEATURES, Feature, FeatureKind


def draw_feature(stream: Stream, robot_x_m: float) -> Feature:
    """Draw a feature, all kinds with equal probability; sizes are those of the data card."""
    kind = stream.choice(dict.fromkeys(FEATURES, 1.0))
    wall = Feature(
        kind=kind, wall_thickness_m=stream.uniform(0.08, 0.30), wall_height_m=stream.uniform(2.4, 3.2)
    )
    return wall.model_copy(update=_draw_sizes(stream, kind, robot_x_m))


def _draw_sizes(stream: Stream, kind: FeatureKind, robot_x_m: float) -> dict[str, float]:
    if kind in ("inner_corner", "outer_corner"):
        # On the other side than the robot, so that it stands before the wall and sees the corner.
        side = -1.0 if robot_x_m > 0 else 1.0
        return {"corner_m": side * stream.uniform(0.25, 1.0)}
    if kind == "cupboard":
        fronts = stream.integer(1, 2)
        return {
            "fronts": fronts,
            "width_m": round(fronts * stream.uniform(0.40, 0.60), 4),
            "top_m": stream.uniform(1.6, 2.3),
            "depth_m": stream.uniform(0.30, 0.60),
        }
    if kind == "window":
        return {
            "width_m": stream.uniform(0.6, 1.6),
            "bottom_m": stream.uniform(0.5, 1.1),
            "top_m": stream.uniform(1.9, 2.3),
        }
    if kind == "niche":
        return {
            "width_m": stream.uniform(0.6, 1.5),
            "bottom_m": 0.0 if stream.chance(0.5) else stream.uniform(0.3, 1.0),
            "top_m": stream.uniform(1.8, 2.3),
            "depth_m": stream.uniform(0.15, 0.60),
        }
    if kind == "passage":
        return {"width_m": stream.uniform(0.8, 2.0), "top_m": stream.uniform(2.0, 2.4)}
    return {}
