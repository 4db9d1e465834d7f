# SPDX-License-Identifier: Apache-2.0
"""Depth cameras that are attached to this machine: one interface, one file a vendor, and a watch over a door."""
