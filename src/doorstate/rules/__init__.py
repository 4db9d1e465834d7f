# SPDX-License-Identifier: Apache-2.0
"""Door states from rules: the related work's methods and the plain baselines, by name (RELATED work: docs/rules.md)."""
