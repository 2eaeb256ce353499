#!/usr/bin/env bash
# Prints the import circles between the source files of each crate. Exit code 1 if a circle has more than three files.
# usage: scripts/circles.sh [--crate NAME] [--edges] [--limit N] [--json]
set -euo pipefail
exec python3 "$(dirname "$0")/circles.py" "$@"
