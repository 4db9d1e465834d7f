# SPDX-License-Identifier: Apache-2.0
"""Training: recipes, one run, one comparison."""
