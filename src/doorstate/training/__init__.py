# SPDX-License-Identifier: Apache-2.0
"""Training: recipes, runs, comparisons and studies."""

from doorstate.errors import check_extra

check_extra("training", "train", "torch", "lightning_fabric")
