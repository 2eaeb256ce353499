#!/usr/bin/env bash
# Fetches the URDFs of public quadrupeds with their meshes for `hoof experiment run robots`: the package example-robot-data 6.0.0 of PyPI.
# usage: scripts/fetch_robots.sh [DIR]     default: target/robots
# Exit code 3 if there is no Python with pip, or the package index cannot be reached.
set -euo pipefail
cd "$(dirname "$0")/.."
to=${1:-target/robots}
package=example-robot-data version=6.0.0
[ -e "$to/VERSION" ] && [ "$(cat "$to/VERSION")" = "$version" ] && exit 0
command -v python3 >/dev/null || { echo "fetch_robots: no python3" >&2; exit 3; }
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
python3 -m pip download --quiet --disable-pip-version-check --no-deps --dest "$work" "$package==$version" >&2 || { echo "fetch_robots: $package $version cannot be fetched" >&2; exit 3; }
rm -rf "$to"; mkdir -p "$to"
python3 - "$work" "$to" <<'PYTHON'
import pathlib, sys, zipfile

names = ["a1", "anymal_b_simple", "anymal_c_simple", "b1", "go1", "go2", "hyq", "laikago", "solo", "z1"]
to = pathlib.Path(sys.argv[2])
[wheel] = pathlib.Path(sys.argv[1]).glob("*.whl")
with zipfile.ZipFile(wheel) as files:
    for name in files.namelist():
        _, found, inside = name.partition("/share/example-robot-data/robots/")
        if found and inside.split("/")[0].removesuffix("_description") in names and not name.endswith("/"):
            # The folders of the package, so that package:// names are found.
            path = to / "example-robot-data" / "robots" / inside
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(files.read(name))
PYTHON
echo "$version" > "$to/VERSION"
