# SPDX-License-Identifier: Apache-2.0
"""From saved predictions to tables, figures and the report; nothing is recomputed."""

from doorstate.errors import check_extra

check_extra("evaluation", "train", "pandas")
