# SPDX-License-Identifier: Apache-2.0
"""The state of a door from one depth-camera point cloud."""

__version__ = "0.1.0"
