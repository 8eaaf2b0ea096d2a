#!/usr/bin/env bash
# Tools that the rings need: the stable toolchain with its target and components, QEMU for Arm, a browser, Python.
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
# Names of packages as Debian has them, where the command that they bring is not there.
missing=()
need() { command -v "$1" >/dev/null || missing+=("$2"); }
need qemu-system-arm qemu-system-arm
# The page of `prehend view` is looked at in a browser, its text in some font.
need chromium chromium
need chromedriver chromium-driver
{ fc-list 2>/dev/null || true; } | grep -q . || missing+=(fonts-dejavu-core)
# Readers of other people for what is exported, pinned in .ci/requirements.txt.
need python3 python3
python3 -c 'import ensurepip' 2>/dev/null || missing+=(python3-venv)
if [ "${#missing[@]}" -gt 0 ]; then
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    apt-get update -qq && apt-get install -y -qq --no-install-recommends "${missing[@]}"
  else
    say_missing "sudo apt-get install ${missing[*]} (Debian's names; your system's packages may have others)"
  fi
fi
cargo --version
qemu-system-arm --version | head -1
