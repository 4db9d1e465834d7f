#!/usr/bin/env bash
# Make a virtual environment with everything in requirements.lock and this project in it.
set -euo pipefail
venv=$1

usable() { "$1" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

find_python() {
  for python in "${PYTHON:-}" python3.11 python3.12 python3.13 python3; do
    if [ -n "$python" ] && command -v "$python" >/dev/null && usable "$python"; then echo "$python"; return; fi
  done
}

python=$(find_python)
# A bare Debian machine: Python without venv, or none at all.
if [ -z "$python" ] && command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
  apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq python3 python3-venv >&2
  python=$(find_python)
fi
if [ -z "$python" ]; then
  echo "setup: needs Python 3.11 or newer with venv (Debian: apt-get install python3 python3-venv), or set PYTHON" >&2
  exit 1
fi

"$python" -m venv --clear "$venv"
install() { "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"; }

# The lock file has the sums of PyTorch's builds for CPUs; that of PyPI for Linux needs gigabytes of CUDA. Torch alone is
# looked for in that index, and pip goes on without it where another place has the same file.
install --retries 0 --require-hashes --no-deps --extra-index-url https://download.pytorch.org/whl/cpu \
  -r <(sed -n '/^torch==/,/[^\\]$/p' requirements.lock)
install --require-hashes -r requirements.lock
install --no-deps --no-build-isolation --editable .
# Quick sampling ships as source. Without a compiler the NumPy form gives the same indices, ten times slower.
install --require-hashes --no-deps -r <(sed -n 's/^# optional: //p' requirements.lock) \
  || echo "setup: fpsample was not built (no C++ compiler?): sampling falls back to NumPy" >&2
