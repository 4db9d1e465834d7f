#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The whole pipeline, small: simulate, prepare, cross-validate five networks, report, classify files.
# Started again, finished steps are kept.
set -euo pipefail
folder=$1

run() {
  printf '\n$ doorstate %s\n' "$*"
  doorstate "$@"
}

run simulate --preset ogurob --poses 80 --out "$folder/simulated"
run prepare "$folder/simulated" --points 512 --out "$folder/clouds"
run compare tools/demo.toml --data "$folder/clouds" --jobs 2 --out "$folder/comparison"
run report "$folder/comparison" --out "$folder/report"
# New doors as files, from another seed: what a robot would hand over.
run simulate --preset ogurob --poses 5 --seed 7 --keep pcd --out "$folder/new"
run predict "$folder/new/pcd" --weights "$folder/comparison/runs/pointnet2/fold0/weights.safetensors"
# The same files with the packaged weights, trained on the complete data set.
run predict "$folder/new/pcd"
printf '\nThe report: %s/report/report.html\nDone in %d s.\n' "$(cd "$folder" && pwd)" "$SECONDS"
