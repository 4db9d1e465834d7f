# SPDX-License-Identifier: Apache-2.0
"""Files, depth images, bags and ROS messages, read as clouds in metres in the body frame."""
