# SPDX-License-Identifier: Apache-2.0
"""Speed of networks, rules, predictors and the service: `python -m benchmarks --help`."""
