#!/usr/bin/env bash
# Print the lock file: what the project and its tests need, as installed in the given environment.
set -euo pipefail
echo "# What 'make setup' installs; written by 'make lock'."
echo "# optional: $("$1/bin/python" -m pip freeze | grep '^fpsample==')"
# With --all, for setuptools: tests build the wheel without fetching it.
"$1/bin/python" -m pip freeze --all --exclude pip --exclude-editable --exclude fpsample --exclude atheris | sed 's/^torch==\([0-9.]*\)+.*/torch==\1/'
