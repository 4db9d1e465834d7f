# SPDX-License-Identifier: Apache-2.0
"""Random scenes as rich as real buildings; the ranges are in docs/buildings.md."""
