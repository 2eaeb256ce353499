#!/usr/bin/env bash
# Replays the golden logs with two other builds of the replay program (unoptimised; with every instruction set of this CPU) and with the shipped build on
# an emulated CPU of 2006 (no AVX, no FMA). Every bit must equal the record. `cargo test` replays them with the shipped build on this CPU.
# Only what a replay needs is built; the two other builds have target directories of their own. `make test` calls this script.
# usage: scripts/replay_across_builds.sh [CORPUS]
set -euo pipefail
cd "$(dirname "$0")/.."

golden=${1:-logs/golden}
target=${CARGO_TARGET_DIR:-target}
# Flags of the caller would change all three builds.
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS
failed=0

echo "unoptimised (dev profile, opt-level 0)"
CARGO_PROFILE_DEV_OPT_LEVEL=0 CARGO_PROFILE_DEV_DEBUG=false cargo run --quiet --locked --package replay --example replay_golden \
    --target-dir "$target/replay-dev" -- "$golden" || failed=1

echo "every instruction set of this CPU (release profile, -C target-cpu=native)"
RUSTFLAGS="-C target-cpu=native" cargo run --quiet --locked --release --package replay --example replay_golden \
    --target-dir "$target/replay-native" -- "$golden" || failed=1

echo "an emulated CPU without AVX and FMA (release profile, qemu-x86_64 -cpu core2duo)"
if command -v qemu-x86_64 >/dev/null; then
    # `cargo test --workspace` has built this example with the same features, so nothing is compiled again.
    cargo build --quiet --locked --release --workspace --example replay_golden
    qemu-x86_64 -cpu core2duo "$target/release/examples/replay_golden" "$golden" || failed=1
else
    echo "error: qemu-x86_64 not found; run scripts/setup.sh (Debian's package qemu-user)" >&2
    failed=1
fi

exit "$failed"
