# SPDX-License-Identifier: Apache-2.0
"""Fast forms of network operations that compute the same as the plain ones; each file gives its derivation.

A plain twin of each is in the tests.
"""
