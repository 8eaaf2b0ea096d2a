#!/usr/bin/env bash
# Who may import whom (docs/architecture.md). Cargo holds the arrows between packages; this holds the rest.
set -euo pipefail
cd "$(dirname "$0")/.."
status=0
fail() { echo "arrow broken: $*" >&2; status=1; }

# Packages, by what cargo resolves. -e normal: a test may look at more than the code it tests.
tree() { cargo tree --locked -e normal --prefix none "$@" | awk '{print $1}' | sort -u; }
depends() { local wanted=$1; shift; tree "$@" | grep -qx "$wanted"; }

depends firmware -p host --no-default-features && fail "host without 'twin' depends on firmware"
depends nalgebra -p protocol && fail "protocol depends on nalgebra"
for member in hand-model firmware host hil-tests; do
  depends "$member" -p protocol && fail "protocol depends on $member"
done
for member in firmware host hil-tests; do
  depends "$member" -p hand-model && fail "hand-model depends on $member"
done
for member in host hil-tests; do
  depends "$member" -p firmware && fail "firmware depends on $member"
done

# Modules: no line of code in FOLDER may name one of the paths matched by PATTERN.
forbid() {
  local folder=$1 pattern=$2 found
  [ -e "$folder" ] || { fail "$folder is named here but does not exist"; return; }
  found=$(grep -rnE --include='*.rs' "$pattern" "$folder" | grep -vE '^[^:]+:[0-9]+:\s*//' || true)
  [ -z "$found" ] || fail "$folder names what it may not:"$'\n'"$found"
}
for stage in scan surface grasp plan; do
  forbid "host/src/$stage" '\bfirmware::|crate::(link|twin|exec|cli)\b'
done
for part in exec export link io object record view serve; do
  forbid "host/src/$part" '\bfirmware::|crate::(twin|cli)\b'
done
forbid host/src/export '\bfirmware::|crate::(twin|cli|exec)\b'
forbid firmware/src/control '\bembassy|crate::(board|session)\b'
forbid host/src/twin/plant.rs 'firmware::'

# unsafe lives on the boards only.
# A counting allocator in a test is the exception: it cannot be written without.
unsafe=$(grep -rnE --include='*.rs' --exclude-dir=target --exclude=io_bad_files.rs '\bunsafe\b' protocol firmware host hil-tests | grep -vE '^firmware/src/(board|bin)/|^[^:]+:[0-9]+:\s*//|unsafe_code' || true)
[ -z "$unsafe" ] || fail "unsafe outside firmware/src/board:"$'\n'"$unsafe"

[ "$status" = 0 ] && echo "arrows hold"
exit "$status"
