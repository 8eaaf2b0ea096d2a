#!/usr/bin/env bash
# The README's first command, twice with one seed: it must do its job and leave the same bytes.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
cargo build --locked --release
for run in a b; do
  cargo run --locked --release -q -- demo --out "$out/$run"
done
for file in cloud.ply mesh.stl mesh.iv plan.json grasp.png report.html; do
  cmp "$out/a/$file" "$out/b/$file"
done
echo "demo: two runs with one seed left the same bytes"
