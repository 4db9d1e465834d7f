# SPDX-License-Identifier: Apache-2.0
"""Start the node with the parameters of config/doorstate.yaml or of another file, and the topics of a camera."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# The node's topics, by the names of a RealSense.
TOPICS = {
    "cloud": "/camera/camera/depth/color/points",
    "depth": "/camera/camera/depth/image_rect_raw",
    "compressed_depth": "/camera/camera/depth/image_rect_raw/compressedDepth",
    "camera_info": "/camera/camera/depth/camera_info",
}


def generate_launch_description() -> LaunchDescription:
    """Return the description of the node, for `ros2 launch`."""
    parameters = PathJoinSubstitution([FindPackageShare("doorstate_ros"), "config", "doorstate.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file", default_value=parameters, description="Parameters of the node"
            ),
            DeclareLaunchArgument("name", default_value="doorstate", description="Name of the node"),
            *(
                DeclareLaunchArgument(topic, default_value=default, description=f"Topic for {topic}")
                for topic, default in TOPICS.items()
            ),
            Node(
                package="doorstate_ros",
                executable="doorstate_node",
                name=LaunchConfiguration("name"),
                parameters=[LaunchConfiguration("params_file")],
                remappings=[(topic, LaunchConfiguration(topic)) for topic in TOPICS],
                output="screen",
            ),
        ]
    )
