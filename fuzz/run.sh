#!/usr/bin/env bash
# Builds the fuzz targets with the stable compiler and runs one, or each in turn:  fuzz/run.sh SECONDS [TARGET]
# cargo-fuzz does the same on a nightly compiler; there is no unsafe code in what is fuzzed, so coverage is requested and no sanitizer.
set -euo pipefail
cd "$(dirname "$0")"
seconds=${1:?SECONDS}
targets=${2:-event_log mcap lcm_types reassembly}
host=$(rustc -vV | sed -n 's/^host: //p')
export RUSTC_BOOTSTRAP=1 CARGO_TARGET_DIR=${FUZZ_TARGET_DIR:-target}
export RUSTFLAGS="--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 -Cdebug-assertions=yes -Coverflow-checks=yes"
cargo build --release --target "$host"
for target in $targets; do
    mkdir -p "corpus/$target" "artifacts/$target"
    # The golden logs and our own types are where it starts from.
    case $target in
    mcap) for log in ../logs/golden/*.mcap; do tail -c +9 "$log" >"corpus/$target/$(basename "$log")"; done ;;
    lcm_types) for text in ../lcmtypes/*.lcm; do cp "$text" "corpus/$target/"; done ;;
    event_log) tail -c +5 ../replay/tests/data/stock.lcmlog >"corpus/$target/stock" ;;
    esac
    "$CARGO_TARGET_DIR/$host/release/$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -max_len=16384 \
        -print_final_stats=1 -artifact_prefix="artifacts/$target/" "corpus/$target"
done
