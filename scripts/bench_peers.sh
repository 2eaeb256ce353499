#!/usr/bin/env bash
# Installs and builds the libraries that `make bench` compares with: Pinocchio and four solvers of quadratic programs, from PyPI and Debian.
# Everything is written below target/peers; Debian packages are installed as in scripts/setup.sh. Steps that are done are skipped.
# The first run takes some minutes: Pinocchio is compiled from its headers for this CPU, to be as fast as possible.
# usage: scripts/bench_peers.sh [DIR]
set -euo pipefail
cd "$(dirname "$0")/.."

peers=${1:-target/peers}
sources=benches/peers
pin_version=4.1.0
# Archives of sources (of headers, for the wheel), by name and SHA-256.
archives=(
    "daqp==0.11.0 daqp-0.11.0.tar.gz 2f27baf18d2acca14186498e651b34e0bed455627e777d3fd8ba655e7e40f920"
    "eiquadprog==1.3.2 eiquadprog-1.3.2.tar.gz ac6652d815c7c48333a206bddfdc3c92d7a64a380e42f0252d69585be1d046e6"
    "piqp==0.7.0 piqp-0.7.0.tar.gz e4f573a435f8609f2c5e14352b44307ce4dd643ce1874ab23f68d7d4105b54a3"
)
proxsuite_version=0.8.0
optimised="-O3 -march=native -DNDEBUG"

say() { printf 'bench_peers: %s\n' "$*"; }
fail() { printf 'bench_peers: %s\n' "$*" >&2; exit 1; }

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail "not root, and sudo not found; run as root, then start again: $*"
    fi
}

# Checks for the files themselves: another package may provide them.
install_packages() {
    local missing=()
    command -v g++ >/dev/null || missing+=(g++)
    [ -f /usr/include/eigen3/Eigen/Core ] || missing+=(libeigen3-dev)
    [ -f /usr/include/simde/x86/avx2.h ] || missing+=(libsimde-dev)
    command -v taskset >/dev/null || missing+=(util-linux)
    python3 -m pip --version >/dev/null 2>&1 || missing+=(python3 python3-pip)
    [ ${#missing[@]} -gt 0 ] || return 0
    say "installing ${missing[*]}"
    local install=(env DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends "${missing[@]}")
    as_root "${install[@]}" || { as_root apt-get update && as_root "${install[@]}"; }
}

# Slow, because pip runs the archive's build tools to read its metadata.
fetch_sources() {
    local entry package file hash
    mkdir -p "$peers/archives" "$peers/src"
    for entry in "${archives[@]}"; do
        read -r package file hash <<<"$entry"
        [ -d "$peers/src/${file%.tar.gz}" ] && continue
        say "fetching $package"
        python3 -m pip download --quiet --no-deps --no-binary "${package%%==*}" --dest "$peers/archives" "$package"
        sha256sum --check --quiet - <<<"$hash  $peers/archives/$file" || fail "$file is not the pinned file"
        tar --extract --gzip --file "$peers/archives/$file" --directory "$peers/src"
    done
}

# Wheels: Pinocchio with the libraries that it needs, and ProxQP (headers only).
fetch_wheels() {
    [ -f "$prefix/include/pinocchio/config.hpp" ] && [ -f "$prefix/include/proxsuite/config.hpp" ] && return 0
    say "fetching pin $pin_version and proxsuite $proxsuite_version"
    rm -rf "$peers/python"
    python3 -m pip install --quiet --root-user-action ignore --only-binary :all: --target "$peers/python" "pin==$pin_version" "proxsuite==$proxsuite_version"
}

# Pinocchio's wheel converts each URDF to a text archive once: the benchmark is compiled for this CPU and cannot share matrices with the wheel's library.
archive_robots() {
    local robot
    for robot in hyq anymal_b; do
        local urdf="robots/$robot/$robot.urdf" text="$peers/$robot.txt"
        [ "$text" -nt "$urdf" ] && continue
        PYTHONPATH="$peers/python:$(echo "$prefix"/lib/python3*/site-packages)" python3 - "$urdf" "$text" <<'PYTHON'
import sys
import pinocchio

pinocchio.buildModelFromUrdf(sys.argv[1], pinocchio.JointModelFreeFlyer()).saveToText(sys.argv[2])
PYTHON
    done
}

# build NAME ARGUMENTS…: compiles benches/peers/NAME.cpp to bin/NAME, unless bin/NAME is newer than every source and this script.
build() {
    local name=$1 program="$peers/bin/$1"
    shift
    if [ -f "$program" ] && [ -z "$(find "$sources/$name.cpp" "$sources"/*.hpp scripts/bench_peers.sh -newer "$program")" ]; then
        return 0
    fi
    say "compiling $name"
    # shellcheck disable=SC2086 # several arguments each
    g++ -std=c++17 $optimised -w -isystem /usr/include/eigen3 -o "$program" "$sources/$name.cpp" "$@"
}

build_solvers() {
    local daqp=$peers/src/daqp-0.11.0/csrc eiquadprog=$peers/src/eiquadprog-1.3.2 object
    mkdir -p "$peers/bin" "$peers/daqp" "$peers/include/eiquadprog"
    for file in "$daqp"/src/*.c; do
        object=$peers/daqp/$(basename "$file" .c).o
        # shellcheck disable=SC2086
        [ -f "$object" ] || gcc $optimised -I "$daqp/include" -c "$file" -o "$object"
    done
    build daqp -I "$daqp/include" "$peers"/daqp/*.o
    # In a build by CMake, CMake writes this header.
    printf '#pragma once\n#define EIQUADPROG_DLLAPI\n' >"$peers/include/eiquadprog/config.hpp"
    build eiquadprog -I "$eiquadprog/include" -I "$peers/include" "$eiquadprog/src/eiquadprog-fast.cpp"
    build piqp -I "$peers/src/piqp-0.7.0/include"
    build proxqp -DPROXSUITE_VECTORIZE -isystem "$prefix/include"
}

# The definitions are those of Pinocchio's CMake package.
build_pinocchio() {
    build pinocchio -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS \
        -DBOOST_FUSION_INVOKE_MAX_ARITY=12 -isystem "$prefix/include" -L "$prefix/lib" -Wl,-rpath,"$(realpath "$prefix/lib")" \
        -lboost_serialization
}

prefix=$peers/python/cmeel.prefix
install_packages
fetch_sources
fetch_wheels
archive_robots
build_solvers
build_pinocchio
cat >"$peers/VERSIONS" <<TEXT
peers: g++ $(g++ -dumpfullversion) $optimised
Pinocchio $pin_version, from its headers
DAQP 0.11.0, eiquadprog 1.3.2, ProxQP $proxsuite_version, PIQP 0.7.0
TEXT
say "ready: $(paste -sd ';' "$peers/VERSIONS")"
