#!/usr/bin/env bash
# A live run over a network that loses one datagram in a hundred in each direction: the driver is on one network, controller and recorder on another; one relay
# passes measurements, another passes commands. The log must still replay bit for bit.
# usage: scripts/lossy_run.sh HOOF LOSSY_RELAY [SECONDS]
set -euo pipefail
cd "$(dirname "$0")/.."
hoof=${1:?the command, such as target/release/hoof}
relay=${2:?the relay, such as target/release/examples/lossy_relay}
seconds=${3:-60}
robot_side="udpm://239.255.76.67:7691?ttl=0&recv_buf_size=2000000"
control_side="udpm://239.255.76.67:7692?ttl=0&recv_buf_size=2000000"
out=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$out"' EXIT

: >"$out/stderr"
"$relay" "$robot_side" "$control_side" --drop 0.01 --seed 1 --channels "ROBOT_INFO|ROBOT_STATE|OPERATOR_COMMAND|GROUND_TRUTH|EVENT" >"$out/states" 2>>"$out/stderr" &
states=$!
"$relay" "$control_side" "$robot_side" --drop 0.01 --seed 2 --channels "ROBOT_COMMAND|EXPECTED_ROBOT" >"$out/commands" 2>>"$out/stderr" &
commands=$!
"$hoof" log record "$out/run.mcap" --lcm-url "$control_side" >/dev/null 2>&1 &
recorder=$!
until [ "$(grep -c relaying "$out/stderr")" = 2 ]; do :; done
"$hoof" driver runs/hyq_sim.toml --scenario scenarios/rough_trot.toml --lcm-url "$robot_side" >"$out/driver" 2>/dev/null &
driver=$!
"$hoof" controller runs/hyq_sim.toml --seconds "$seconds" --lcm-url "$control_side" 2>/dev/null
kill -INT "$driver" "$recorder"
wait "$driver" "$recorder" || true
kill -INT "$states" "$commands"
wait "$states" "$commands"
cat "$out/driver"
python3 - "$out/states" "$out/commands" <<'PYTHON'
import json, sys

for path in sys.argv[1:]:
    account = json.load(open(path))
    print(f"{path.rsplit('/', 1)[1]}: {account['lost']} of {account['messages']} messages lost")
PYTHON
"$hoof" replay "$out/run.mcap"
