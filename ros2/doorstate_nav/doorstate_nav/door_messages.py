# SPDX-License-Identifier: Apache-2.0
"""Subscription to the doors of nodes of doorstate_ros, into a `DoorMemory`."""

from __future__ import annotations

import time
from typing import Any

from doorstate_msgs.msg import Doors
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from doorstate_nav.memory import DoorMemory

LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


def remember_doors(node: Any, memory: DoorMemory, **options: Any) -> None:
    """Subscribe to the topic `door_list`."""
    node.create_subscription(
        Doors, "door_list", lambda message: memory.update(message, time.monotonic()), LATCHED, **options
    )


def parameter(node: Any, name: str, default: Any, description: str) -> Any:
    """Declare a parameter that is read at the start; return its value."""
    from rcl_interfaces.msg import ParameterDescriptor

    descriptor = ParameterDescriptor(name=name, description=description, read_only=True)
    return node.declare_parameter(name, default, descriptor).value


def spin(make_node: Any, threads: int = 1) -> int:
    """Run a node until it is stopped; return 1 after one line on standard error if it cannot start.

    Args:
        make_node: makes the node.
        threads: callbacks that run at the same time.
    """
    import sys

    import rclpy
    from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor

    from doorstate.errors import DoorstateError

    rclpy.init()
    try:
        rclpy.spin(make_node(), MultiThreadedExecutor(threads))
    except (DoorstateError, ValueError) as error:
        print(f"doorstate_nav: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        rclpy.try_shutdown()
    return 0
