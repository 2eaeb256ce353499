#!/usr/bin/env bash
# Measures the lateness of the real-time thread: `hoof run` without a robot and cyclictest run at the same time, with the same period and priority, first on
# the idle machine, then with every core busy. Needs cyclictest (Debian's rt-tests). Results of one machine: docs/operating.md, "Timing".
# usage: scripts/jitter.sh HOOF [SECONDS [CORE]]      with CORE both run on that core
set -euo pipefail
cd "$(dirname "$0")/.."
hoof=${1:?the command to measure, such as target/release/hoof}
seconds=${2:-60}
core=${3:-}
command -v cyclictest >/dev/null || { echo "error: cyclictest not found; run: apt-get install rt-tests" >&2; exit 1; }
out=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$out"' EXIT

run=runs/hyq_dummy.toml
if [ -n "$core" ]; then
    run=$out/run.toml
    printf '\n[realtime]\ncore = %s\n' "$core" | cat runs/hyq_dummy.toml - >"$run"
fi

measure() {  # NAME
    cyclictest ${core:+--affinity="$core"} --mlockall --priority=80 --interval=1000 --duration="$seconds" --quiet --histogram=100000 >"$out/cyclictest" &
    local beside=$!
    "$hoof" run "$run" --seconds "$seconds" --log "$out/$1.mcap" 2>"$out/stderr" >/dev/null || { cat "$out/stderr" >&2; exit 1; }
    wait "$beside"
    "$hoof" replay "$out/$1.mcap" >"$out/replay" || { cat "$out/replay" >&2; exit 1; }
    "$hoof" log cat "$out/$1.mcap" --channels TIMING --json >"$out/timing"
    python3 - "$1" "$out" <<'PYTHON'
import json, sys

PERIOD = 1_000_000  # ns
name, out = sys.argv[1:]


def quantiles(us):
    us = sorted(us)
    return [us[min(int(q * len(us)), len(us) - 1)] for q in (0.5, 0.99, 0.999)] + [us[-1]]


ticks = [json.loads(line)["fields"] for line in open(f"{out}/timing")]
late = [(tick["wake_ns"] - (tick["deadline_ns"] - PERIOD)) / 1e3 for tick in ticks]
missed = sum(tick["end_ns"] > tick["deadline_ns"] for tick in ticks)
# A skipped tick makes one period too long.
off = [(b["wake_ns"] - a["wake_ns"] - PERIOD) / 1e3 for a, b in zip(ticks, ticks[1:])]
rms = (sum(x * x for x in off) / len(off)) ** 0.5
skipped = round((ticks[-1]["deadline_ns"] - ticks[0]["deadline_ns"]) / PERIOD) + 1 - len(ticks)
counts = [(int(us), int(n)) for us, n, *_ in (line.split() for line in open(f"{out}/cyclictest") if line[:1].isdigit())]
stock = [us for us, n in counts for _ in range(n)]
replayed = open(f"{out}/replay").readline().strip()
print(f"{name}: {replayed}; {missed} late, {skipped} skipped; period error {rms:.0f} us rms")
for program, us in (("this", late), ("cyclictest", stock)):
    p50, p99, p999, worst = quantiles(us)
    print(f"  {program:<10} woken late, us: p50 {p50:.0f}, p99 {p99:.0f}, p99.9 {p999:.0f}, max {worst:.0f}")
PYTHON
}

measure idle
for _ in $(seq "$(nproc)"); do sha256sum /dev/zero & done
measure loaded
