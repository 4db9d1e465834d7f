# SPDX-License-Identifier: Apache-2.0
"""Pages that show clouds, predictions and recordings."""
