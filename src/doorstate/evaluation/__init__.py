# SPDX-License-Identifier: Apache-2.0
"""From saved predictions to tables, figures and the report; nothing is recomputed."""
