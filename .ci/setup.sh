#!/usr/bin/env bash
# Tools that the rings need: the stable toolchain with its target and components, and QEMU for Arm.
set -euo pipefail
say_missing() { echo "missing: $1" >&2; exit 1; }

command -v cargo >/dev/null || say_missing "cargo: install Rust by rustup (https://rustup.rs)"
if command -v rustup >/dev/null; then
  rustup target add thumbv7em-none-eabihf thumbv8m.main-none-eabihf
  rustup component add rustfmt clippy
else
  cargo fmt --version >/dev/null || say_missing "rustfmt (no rustup here to add it)"
  cargo clippy --version >/dev/null || say_missing "clippy (no rustup here to add it)"
fi
if ! command -v qemu-system-arm >/dev/null; then
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    apt-get update -qq && apt-get install -y -qq --no-install-recommends qemu-system-arm
  else
    say_missing "qemu-system-arm: sudo apt-get install qemu-system-arm (Debian, Ubuntu), or your system's QEMU package"
  fi
fi
cargo --version
qemu-system-arm --version | head -1
