#!/bin/sh
# Regenerates lcmtypes/src/bus/ffi.rs from the installed liblcm (Debian: liblcm-dev, libclang-dev).
# With --check: only compares; exit code 1 if the committed file differs.
set -eu
cd "$(dirname "$0")/.."

committed=lcmtypes/src/bus/ffi.rs
fresh=$(mktemp)
trap 'rm -f "$fresh"' EXIT

{
    echo "// Generated from lcm/lcm.h by scripts/regenerate_bindings.sh, not to be edited."
    echo
    cargo run --quiet --locked --manifest-path lcmtypes/bindings/Cargo.toml --target-dir target/bindings
} > "$fresh"
rustfmt --edition 2024 --config-path . "$fresh"

if [ "${1-}" = --check ]; then
    diff -u "$committed" "$fresh"
else
    cp "$fresh" "$committed"
fi
