#!/usr/bin/env bash
# The README's first command, twice with one seed: it must do its job and leave the same bytes.
set -euo pipefail
source "$(dirname "$0")/release.sh"
for run in a b; do
  prehend demo --out "$out/$run"
done
for file in cloud.ply mesh.stl mesh.iv plan.json grasp.png run.json report.html; do
  cmp "$out/a/$file" "$out/b/$file"
done
echo "demo: two runs with one seed left the same bytes"
