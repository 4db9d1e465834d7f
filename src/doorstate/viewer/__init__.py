# SPDX-License-Identifier: Apache-2.0
"""HTML pages that show clouds, predictions and recordings in 3D."""
