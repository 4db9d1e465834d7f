# SPDX-License-Identifier: Apache-2.0
"""Start the action server, and with a table of edges the client of the route server."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """Return the description of the nodes, for `ros2 launch`."""
    edges, door_list = LaunchConfiguration("edges"), LaunchConfiguration("door_list")
    remappings = [("door_list", door_list)]
    return LaunchDescription(
        [
            DeclareLaunchArgument("edges", default_value="", description="Table of doors and edges (YAML)"),
            DeclareLaunchArgument(
                "door_list", default_value="/doorstate/door_list", description="Topic of the doors"
            ),
            Node(package="doorstate_nav", executable="wait_server", remappings=remappings, output="screen"),
            Node(
                package="doorstate_nav",
                executable="edge_client",
                parameters=[{"edges": edges}],
                remappings=remappings,
                condition=IfCondition(PythonExpression(["'", edges, "' != ''"])),
                output="screen",
            ),
        ]
    )
