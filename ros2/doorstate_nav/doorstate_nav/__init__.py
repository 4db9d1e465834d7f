# SPDX-License-Identifier: Apache-2.0
"""What Nav2 and Open-RMF ask of doors: waiting, edges of a route graph, and the state of a building's doors."""
