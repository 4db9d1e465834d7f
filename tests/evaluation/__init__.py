# SPDX-License-Identifier: Apache-2.0
"""A package, so that file names may repeat those of other rooms' tests."""
