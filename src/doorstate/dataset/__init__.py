# SPDX-License-Identifier: Apache-2.0
"""Prepared clouds on disk: strata, splits, batches."""
