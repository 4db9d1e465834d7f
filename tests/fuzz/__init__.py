# SPDX-License-Identifier: Apache-2.0
"""Fuzz tests of everything that reads foreign bytes: hypothesis in the suite, atheris with `python -m tests.fuzz`."""
