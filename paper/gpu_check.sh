#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Check a machine's CUDA device in under eight minutes, into one file, reports/gpu/gpu.json unless --out is given:
# parity of all networks with the processor, times of training, inference, searches, sampling and rendering.
#
#   paper/gpu_check.sh
#   paper/gpu_check.sh --port-pointnet CHECKOUT --port-dgcnn CHECKOUT
#   paper/gpu_check.sh --device cpu --quick      # tries the check itself, without a CUDA device
#
# Exit codes: 0 every network agrees with the processor, 1 one differs or an error, 2 wrong options, 77 no CUDA device.
set -euo pipefail
cd "$(dirname "$0")/.."
exec "${PYTHON:-python}" -m benchmarks gpu --out reports/gpu "$@"
