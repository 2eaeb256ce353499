#!/usr/bin/env bash
# Replays the golden logs with two builds that are not the one that ships, unoptimised and with every instruction of this CPU, and with the one that
# ships on an emulated CPU of 2006 (no AVX, no FMA). All must give every bit of the record, which the shipped build gives here too: cargo test sees to that.
# Only what a replay needs is built, in target directories of their own. `make test` calls it.
#
#     scripts/replay_across_builds.sh [CORPUS]
set -euo pipefail
cd "$(dirname "$0")/.."

golden=${1:-logs/golden}
target=${CARGO_TARGET_DIR:-target}
# What the caller has set would make other builds than these two.
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_RUSTFLAGS
failed=0

echo "unoptimised (dev profile, opt-level 0)"
CARGO_PROFILE_DEV_OPT_LEVEL=0 cargo run --quiet --locked --package replay --example replay_golden \
    --target-dir "$target/replay-dev" -- "$golden" || failed=1

echo "every instruction of this CPU (release profile, -C target-cpu=native)"
RUSTFLAGS="-C target-cpu=native" cargo run --quiet --locked --release --package replay --example replay_golden \
    --target-dir "$target/replay-native" -- "$golden" || failed=1

echo "an emulated CPU without AVX and FMA (release profile, qemu-x86_64 -cpu core2duo)"
if command -v qemu-x86_64 >/dev/null; then
    cargo build --quiet --locked --release --package replay --example replay_golden --target-dir "$target/replay-release"
    qemu-x86_64 -cpu core2duo "$target/replay-release/release/examples/replay_golden" "$golden" || failed=1
else
    echo "error: qemu-x86_64 is not there: run scripts/setup.sh (Debian's qemu-user)" >&2
    failed=1
fi

exit "$failed"
