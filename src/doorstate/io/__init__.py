# SPDX-License-Identifier: Apache-2.0
"""Readers: files, depth images and recordings to clouds in metres."""
