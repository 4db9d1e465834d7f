#!/usr/bin/env bash
# Build wheel and sdist, and list what the wheel needs, in the versions of requirements-light.lock, as a CycloneDX file.
set -euo pipefail
bin=$1/bin
folder=$2

rm -rf "$folder"
"$bin/python" -m build --no-isolation --outdir "$folder" .
environment=$(mktemp -d)
trap 'rm -rf "$environment"' EXIT
# Without pip of its own, which would be listed.
"$bin/python" -m venv --without-pip "$environment"
install() { "$bin/python" -m pip --python "$environment/bin/python" install --quiet --disable-pip-version-check "$@"; }
install --require-hashes -r requirements-light.lock
install --no-deps "$folder"/*.whl
"$bin/cyclonedx-py" environment --pyproject pyproject.toml --mc-type library --output-reproducible \
  --output-file "$folder/doorstate.cdx.json" "$environment/bin/python"
