# Sourced by the rings that run the command: `prehend` as people build it, and a folder `$out` that goes again.
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
cargo build --locked --release
prehend() { cargo run --locked --release -q -- "$@"; }
