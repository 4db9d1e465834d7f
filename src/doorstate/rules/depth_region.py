# SPDX-License-Identifier: Apache-2.0
"""Free lane ahead: the check of RoboCup@Home start doors, reconstructed without any team's code."""

from __future__ import annotations

import numpy as np

from doorstate.clouds.floor import lowest_z_m
from doorstate.doorways.planes import voxel_downsample
from doorstate.rules.base import Detection, Parameters, Rule, RuleResult
from doorstate.rules.walls import nearby_points
from doorstate.types import DoorState, Points


class DepthRegionParameters(Parameters):
    """Size of the lane ahead, and limits of a blocked, a free and an unknown strip."""

    lane_width_m: float = 0.6  # chosen: service robots are 0.45 to 0.6 m wide
    strips: int = 6  # chosen: of 0.1 m each, a leaf's edge with its handle blocks one
    # Forward; chosen: farthest door of the task (3.5 m) and half a metre; less where rooms are small.
    reach_m: float = 4.0
    farthest_m: float = 6.0  # chosen: beyond it stereo cameras see things under the floor
    nearest_m: float = 0.3  # chosen: the robot's own arm and head
    floor_clearance_m: float = 0.15  # above the lowest points; chosen: noise of the floor, thresholds, mats
    door_height_m: float = 1.9  # above the lowest points; chosen: below the lintel (2.0 m and more)
    camera_height_m: float = 0.2  # above the floor, at least; chosen: a low robot's
    voxel_m: float = 0.04  # chosen: the region's statistics do not depend on the distance of a surface
    min_points: int = 8  # in a strip; chosen: voxels of 0.1 x 0.1 m2, more than flying pixels leave
    min_measured_share: float = 0.3  # of the pixels; chosen: stereo cameras indoors measure half and more


class DepthRegionRule(Rule[DepthRegionParameters]):
    """Closed if all strips of the robot's lane are blocked, open if all are free, semi-open otherwise.

    A strip is free only if its floor was measured beyond the reach; missing readings make it unknown, and then there
    is no state. No angle; a leaf that covers the lane reads as closed.
    """

    name = "depth_region"
    source = "plain baseline: RoboCup@Home start doors"
    defaults = DepthRegionParameters

    def __call__(self, cloud: Points) -> RuleResult:
        p = self.parameters
        points, measured_share = nearby_points(cloud, p.farthest_m)
        if measured_share < p.min_measured_share:
            return RuleResult.abstain("too few pixels were measured")
        if len(points) < p.min_points:
            return RuleResult.abstain("too few points")
        points = voxel_downsample(points, p.voxel_m)
        height_m = points[:, 2] - lowest_z_m(points)
        in_door = (height_m > p.floor_clearance_m) & (height_m < p.door_height_m)
        before_reach = (points[:, 0] > p.nearest_m) & (points[:, 0] < p.reach_m)
        on_floor = (height_m <= p.floor_clearance_m) & (points[:, 2] < -p.camera_height_m)
        floor = on_floor & (points[:, 0] >= p.reach_m)
        strip = np.floor((points[:, 1] / p.lane_width_m + 0.5) * p.strips)
        free = 0
        blocked_at_m = []
        for number in range(p.strips):
            ahead_m = points[(strip == number) & in_door & before_reach, 0]
            if len(ahead_m) >= p.min_points:
                blocked_at_m.append(float(np.median(ahead_m)))
            elif (floor & (strip == number)).sum() >= p.min_points:
                free += 1
        blocked = len(blocked_at_m)
        if blocked + free < p.strips:
            return RuleResult.abstain(
                f"{p.strips - blocked - free} of {p.strips} strips ahead were not measured"
            )
        if blocked == 0:
            return RuleResult(DoorState.OPEN)
        state = DoorState.CLOSED if free == 0 else DoorState.SEMI_OPEN
        half, x = p.lane_width_m / 2, float(np.median(blocked_at_m))
        return RuleResult(
            state, detections=(Detection("surface", np.array([[x, half, 0.0], [x, -half, 0.0]])),)
        )
