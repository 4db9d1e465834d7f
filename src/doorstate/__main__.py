# SPDX-License-Identifier: Apache-2.0
"""`python -m doorstate`: the command line, where the program is not on the path."""

from doorstate.cli import main

if __name__ == "__main__":
    main()
