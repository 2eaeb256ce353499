#!/usr/bin/env bash
# Makes each typical change of scripts/newcomer.toml (a state field, a constraint, a figure, a subcommand) in a copy of the source tree below the target
# directory and compiles it. Exit code 1 if one does not compile.
# usage: scripts/newcomer.sh [--only TEXT] [--edits]      --edits: only check that the edits apply
set -euo pipefail
exec python3 "$(dirname "$0")/newcomer.py" "$@"
