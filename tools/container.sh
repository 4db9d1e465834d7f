#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Build the container, start its service as docs/container.md does, and let it answer; `make container` runs it.
set -euo pipefail
image=doorstate
name=doorstate-check

docker build --tag "$image" .
trap 'docker rm --force "$name" >/dev/null 2>&1 || true' EXIT
docker run --detach --name "$name" --read-only --tmpfs /tmp --cap-drop ALL --security-opt no-new-privileges \
  --env DOORSTATE_TOKEN=of-this-check --publish 127.0.0.1::8000 "$image"
address=$(docker port "$name" 8000/tcp | head -n 1)
for _ in $(seq 60); do
  if curl --silent --fail "http://$address/health" >/dev/null; then break; fi
  sleep 1
done
test "$(docker exec "$name" id -u)" != 0
test "$(curl --silent --output /dev/null --write-out '%{http_code}' --data 1 "http://$address/predict?format=csv")" = 401
# A cloud of one point is answered, and refused: 422.
test "$(curl --silent --output /dev/null --write-out '%{http_code}' --header 'Authorization: Bearer of-this-check' \
  --data-binary $'x,y,z\n1,2,3\n' "http://$address/predict?format=csv")" = 422
docker stop "$name" >/dev/null
test "$(docker inspect --format '{{.State.ExitCode}}' "$name")" = 0
echo "container: built, healthy, answers, and stops"
