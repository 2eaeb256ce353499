#!/usr/bin/env bash
# Judges the source tree: rows {name, published, wanted, measured, unit, pass}, as a table or with --json. Exit code 1 if a row fails.
# usage: scripts/house.sh --base REVISION [--json] [--target-dir DIR]
set -euo pipefail
exec python3 "$(dirname "$0")/house.py" "$@"
