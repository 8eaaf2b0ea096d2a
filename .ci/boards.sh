#!/usr/bin/env bash
# The boards that no emulator runs: lints here; hil-tests links their images and looks into them.
set -euo pipefail
cd "$(dirname "$0")/.."
lint() { cargo clippy --locked -p firmware --features "$1" --bin "$1" --target "$2" -- -D warnings; }
lint stm32g474 thumbv7em-none-eabihf
lint stm32h563 thumbv8m.main-none-eabihf
