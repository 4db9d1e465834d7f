# SPDX-License-Identifier: Apache-2.0
"""From a raw cloud to a prediction."""
