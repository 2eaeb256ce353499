#!/usr/bin/env bash
# Lists old names and phrases with file:line and what to write instead. Exit code 1 if there is one.
# usage: scripts/words.sh [--count | --json] [PATH_PREFIX…]      the list: scripts/words.tsv
set -euo pipefail
exec python3 "$(dirname "$0")/words.py" "$@"
