#!/usr/bin/env bash
# Runs a command and writes how long it took into TARGET_DIR/make_times.json, for scripts/house.sh.
# usage: scripts/timed.sh NAME TARGET_DIR COMMAND…
set -euo pipefail
name=$1 target=$2
shift 2
start=$(date +%s)
code=0
"$@" || code=$?
mkdir -p "$target"
python3 - "$name" "$target/make_times.json" "$(($(date +%s) - start))" "$code" <<'PYTHON'
import json, pathlib, subprocess, sys

name, path, seconds, code = sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
times = json.loads(path.read_text()) if path.is_file() else {}
revision = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True).stdout.strip()
times[name] = {"minutes": round(seconds / 60, 2), "passed": code == 0, "revision": revision}
path.write_text(json.dumps(times, indent=1) + "\n")
print(f"make {name}: {seconds // 60} min {seconds % 60} s, {'passed' if code == 0 else 'failed'}")
PYTHON
exit "$code"
