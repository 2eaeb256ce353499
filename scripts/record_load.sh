#!/usr/bin/env bash
# The recorder and stock lcm-logger on the same traffic: 20 kHz of 400-byte messages, both loggers stopped for 100 ms every 10 s.
# Not part of the gate: it takes a minute, and the result depends on the machine as much as on the loggers.
# usage: scripts/record_load.sh [SECONDS]
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${1:-60}
rate=20000
target=${CARGO_TARGET_DIR:-target}/release
url="udpm://239.255.76.67:7799?ttl=0"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cargo build --release --quiet --package hoofprint --bin hoof
cargo build --release --quiet --package replay --example send_load

"$target/hoof" log record --json --lcm-url "$url" "$work/ours.mcap" >"$work/ours.json" 2>"$work/ours.err" &
ours=$!
lcm-logger --quiet --lcm-url="$url" "$work/stock.lcmlog" >"$work/stock.txt" 2>&1 &
stock=$!
until grep -q '^recording' "$work/ours.err"; do sleep 0.1; done
sleep 1
"$target/examples/send_load" "$url" "$rate" 400 "$seconds" >"$work/sent.txt" &
sender=$!
for ((t = 10; t < seconds; t += 10)); do
    sleep 10
    kill -STOP "$ours" "$stock"
    sleep 0.1
    kill -CONT "$ours" "$stock"
done
wait "$sender"
sleep 1
kill -INT "$ours" "$stock"
wait "$ours" || true
wait "$stock" || true

cat "$work/sent.txt"
python3 - "$work/ours.json" <<'PYTHON'
import json, sys
r = json.load(open(sys.argv[1]))
left_out = sum(r["left_out"].values())
print(f"hoof log record: {r['heard']} recorded, {r['lost']} lost and reported, {left_out} dropped and reported, "
      f"{r['kernel_dropped']} dropped by the kernel, {r['file_bytes'] / 1e6:.0f} MB")
PYTHON
recorded=$("$target/hoof" log info --json "$work/stock.lcmlog" | python3 -c 'import json, sys; print(json.load(sys.stdin)["events"])' || true)
echo "lcm-logger: $recorded recorded; its last line: $(tail -n 1 "$work/stock.txt" | tr -d '\r' | cut -c 1-100)"
