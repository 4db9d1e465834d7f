# SPDX-License-Identifier: Apache-2.0
"""Documentation pages whose figures are computed from `results/`."""
