#!/usr/bin/env bash
# What is exported, read by a reader of somebody else: MuJoCo holds the object of the MJCF scene, and moves the URDFs as we do;
# NumPy reads the arrays.
set -euo pipefail
source "$(dirname "$0")/release.sh"
python=$(.ci/python.sh)
# As `cargo test` has built it.
cargo build --locked --workspace --examples
"${CARGO_TARGET_DIR:-target}/debug/examples/poses" > "$out/poses.json"
prehend demo --out "$out" >/dev/null
for format in urdf urdf-arm mjcf; do
  prehend export "$out/plan.json" --format "$format" -o "$out/$format.xml" >/dev/null
done
prehend export "$out/plan.json" --format npz -o "$out/one.npz" >/dev/null
prehend export "$out/plan.json" --format npz --all -o "$out/all.npz" >/dev/null
for object in cube cylinder mouse; do
  prehend plan "$object" --strategy paper --top 1 -o "$out/$object.json" >/dev/null
  prehend export "$out/$object.json" --format mjcf -o "$out/$object.mjcf.xml" >/dev/null
done
"$python" .ci/readback_npz.py "$out/plan.json" "$out/urdf.xml" "$out/one.npz" "$out/all.npz"
"$python" .ci/readback.py "$out/poses.json" "$out/urdf.xml" "$out/urdf-arm.xml" "$out/mjcf.xml" "$out"/*.mjcf.xml
