#!/usr/bin/env bash
# Compares the torques of this build with those of another revision, in every tick of that revision's golden logs: both builds get the same inputs, converted
# to the types of this build. A torque may differ by 1e-9 of the joint's effort limit; the number of differing bits is printed.
# usage: scripts/compare_revisions.sh REV [HOOF]    HOOF: the command of that revision, if it is built already
set -euo pipefail
cd "$(dirname "$0")/.."
rev=${1:?a revision, such as HEAD~1}
hoof=${2:-}
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT

if [ -z "$hoof" ]; then
    tree=target/compare/tree
    [ -d "$tree" ] || git worktree add --quiet --detach "$tree" "$rev"
    git -C "$tree" checkout --quiet --detach "$rev"
    cargo build --quiet --locked --release --bin hoof --manifest-path "$tree/Cargo.toml" --target-dir target/compare/target
    hoof=target/compare/target/release/hoof
fi
cargo build --quiet --locked --release --package replay --example compare_revisions
git archive "$rev" logs/golden | tar -x -C "$logs"
# Golden logs contain commands of some ticks only: the other build writes those of every tick, after it has found the recorded ones to be equal.
for log in "$logs"/logs/golden/*.mcap; do
    "$hoof" replay "$log" --out "$logs/$(basename "$log")" >/dev/null
done
target/release/examples/compare_revisions "$logs"/*.mcap
