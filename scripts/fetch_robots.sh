#!/usr/bin/env bash
# Fetches all URDFs and SRDFs of two packages of PyPI, example-robot-data and pybullet, for the tests `public_urdfs` and `public_srdfs`, and the meshes of
# public quadrupeds for `hoof experiment run robots`. Nothing is installed. No package of PyPI has a URDF of Unitree's AS2 and B2-W.
# usage: scripts/fetch_robots.sh [DIR]     default: target/robots
# Exit code 3 if there is no Python with pip, or the package index cannot be reached.
set -euo pipefail
cd "$(dirname "$0")/.."
to=${1:-target/robots}
packages="example-robot-data==6.0.0 pybullet==3.2.7"
version="$packages, all URDFs and SRDFs"
[ -e "$to/VERSION" ] && [ "$(cat "$to/VERSION")" = "$version" ] && exit 0
command -v python3 >/dev/null || { echo "fetch_robots: no python3" >&2; exit 3; }
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
for package in $packages; do
    # One build of each package has its data; the platform and the version of Python do not matter.
    python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary :all: --implementation cp --python-version 3.11 \
        --platform manylinux2014_x86_64 --platform manylinux_2_28_x86_64 --dest "$work" "$package" >&2 ||
        { echo "fetch_robots: $package cannot be fetched" >&2; exit 3; }
done
rm -rf "$to"; mkdir -p "$to"
python3 - "$work" "$to" <<'PYTHON'
import pathlib, sys, zipfile

# Prefix in the package, folder that receives the files, and the folders below the prefix of which all files are taken, without `_description`.
SOURCES = [
    ("share/example-robot-data/robots/", "example-robot-data/robots",
     ["a1", "anymal_b_simple", "anymal_c_simple", "b1", "go1", "go2", "hyq", "laikago", "solo", "z1"]),
    ("pybullet_data/", "pybullet_data", ["aliengo", "mini_cheetah"]),
]
to = pathlib.Path(sys.argv[2])
for wheel in pathlib.Path(sys.argv[1]).glob("*.whl"):
    with zipfile.ZipFile(wheel) as files:
        for name in files.namelist():
            for prefix, folder, robots in SOURCES:
                before, found, inside = name.partition(prefix)
                is_prefix = found and (not before or before.endswith("/"))
                # random_urdfs has a thousand boxes and cylinders.
                is_urdf = name.endswith((".urdf", ".srdf")) and not inside.startswith("random_urdfs/")
                is_taken = is_urdf or inside.split("/")[0].removesuffix("_description") in robots
                if is_prefix and is_taken and not name.endswith("/"):
                    # The folders of the package, so that package:// names are found.
                    path = to / folder / inside
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(files.read(name))
PYTHON
echo "$version" > "$to/VERSION"
