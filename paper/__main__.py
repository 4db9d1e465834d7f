# SPDX-License-Identifier: Apache-2.0
"""Run a command of the paper package."""

import sys

from .reproduce import main

main(sys.argv[1:])
