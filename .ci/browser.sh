#!/usr/bin/env bash
# The page of `prehend view` in a headless Chromium: it is drawn, the slider moves the hand, the list sorts, a phone shows it.
set -euo pipefail
source "$(dirname "$0")/release.sh"
python=$(.ci/python.sh)
prehend demo --out "$out/demo" >/dev/null
prehend plan cube --strategy paper --all -o "$out/cube.json" >/dev/null
prehend view "$out/cube.json" -o "$out/cube.html"
"$python" .ci/browser.py "$out/demo/report.html" "$out/cube.html" "$out/cube.json"
