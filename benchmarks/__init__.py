# SPDX-License-Identifier: Apache-2.0
"""Speed of the networks and of the whole way from a raw cloud to a state: `python -m benchmarks --help`."""
