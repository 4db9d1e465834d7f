# SPDX-License-Identifier: Apache-2.0
"""Training: recipes, runs, comparisons and studies."""
