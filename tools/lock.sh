#!/usr/bin/env bash
# Print the lock file: what the project and its tests need, as installed in the given environment.
set -euo pipefail
echo "# What 'make setup' installs; written by 'make lock'."
echo "# optional: $("$1/bin/python" -m pip freeze | grep '^fpsample==')"
"$1/bin/python" -m pip freeze --exclude-editable --exclude fpsample | sed 's/^torch==\([0-9.]*\)+.*/torch==\1/'
