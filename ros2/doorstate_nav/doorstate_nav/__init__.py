# SPDX-License-Identifier: Apache-2.0
"""Doors for Nav2 and Open-RMF: an action that waits, edges of a route graph, and door states."""
