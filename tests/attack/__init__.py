# SPDX-License-Identifier: Apache-2.0
"""Attacks that earlier versions did not stand, repeated at full length: `python -m tests.attack`."""
