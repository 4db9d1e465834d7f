# SPDX-License-Identifier: Apache-2.0
"""Fast exact forms of network operations."""
