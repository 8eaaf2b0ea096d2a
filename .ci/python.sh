#!/usr/bin/env bash
# Prints the Python that has .ci/requirements.txt, in an environment of its own beside the build's results.
set -euo pipefail
cd "$(dirname "$0")/.."
environment=${CARGO_TARGET_DIR:-target}/python
if ! cmp -s .ci/requirements.txt "$environment/installed.txt"; then
  rm -rf "$environment"
  python3 -m venv "$environment" >&2
  "$environment/bin/pip" install --quiet --disable-pip-version-check --requirement .ci/requirements.txt >&2
  cp .ci/requirements.txt "$environment/installed.txt"
fi
echo "$environment/bin/python"
