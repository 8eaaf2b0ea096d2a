#!/usr/bin/env bash
# The packages that run on the hand compile for its processor, without std and without alloc.
set -euo pipefail
cd "$(dirname "$0")/.."
target=thumbv7em-none-eabihf
cargo clippy --locked -p protocol -p hand-model -p firmware --lib --target "$target" -- -D warnings
cargo clippy --locked -p firmware --features panic-free --bin panic-free --target "$target" -- -D warnings
cargo clippy --locked -p firmware --features mps2-an386 --bin mps2-an386 --target "$target" -- -D warnings
