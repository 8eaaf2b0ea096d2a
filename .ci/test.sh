#!/usr/bin/env bash
# Host tests of every package, doctests included; hil-tests among them builds the firmware image and runs it in QEMU.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --locked --workspace
