#!/usr/bin/env bash
# Format, lints as errors, documentation without warnings. Rows of features that are supported builds:
# the default, the host without the twin, and the boards (in thumb.sh and boards.sh).
set -euo pipefail
cd "$(dirname "$0")/.."
cargo fmt --all -- --check
cargo clippy --locked --workspace --all-targets -- -D warnings
cargo clippy --locked -p host --lib --no-default-features -- -D warnings
RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace --no-deps
