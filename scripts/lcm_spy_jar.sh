#!/usr/bin/env bash
# Builds the stock lcm-spy with the message types of this project in FOLDER.
# usage: scripts/lcm_spy_jar.sh FOLDER
# lcm-spy decodes messages with Java classes: stock lcm-gen generates them from the .lcm files, javac compiles them into FOLDER/hoofprint_types.jar.
# Debian's lcm-spy does not start under Debian's Java 17 (it passes -Xincgc), so lcm-spy and lcm.jar are from PyPI's lcm 1.5.3, pinned by hash.
# Missing programs are listed; INSTALL=1 installs them.
set -euo pipefail
cd "$(dirname "$0")/.."

wheel_version=1.5.3
wheel_sha256=1d4eb1e1a3fe20242a7149d6d56192f652d25701feae18d9774b4f69f10ef445
folder=${1:?usage: lcm_spy_jar.sh FOLDER}
mkdir -p "$folder"
folder=$(realpath "$folder")
jar=$folder/hoofprint_types.jar

say() { printf 'lcm-spy: %s\n' "$*"; }
fail() { printf 'lcm-spy: %s\n' "$*" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

check_tools() {
    local missing=()
    command -v lcm-gen >/dev/null || missing+=(liblcm-bin)
    command -v javac >/dev/null && command -v jar >/dev/null || missing+=(default-jdk-headless)
    python3 -m pip --version >/dev/null 2>&1 || missing+=(python3-pip)
    [ ${#missing[@]} -gt 0 ] || return 0
    local install=(apt-get install --yes --no-install-recommends "${missing[@]}")
    [ "$(id -u)" = 0 ] || install=(sudo "${install[@]}")
    [ "${INSTALL:-}" = 1 ] || fail "missing: ${missing[*]}; make lcm-spy INSTALL=1 installs them: ${install[*]}"
    say "installing ${missing[*]}"
    "${install[@]}"
}

fetch_spy() {
    [ -x "$folder/bin/lcm-spy" ] && [ -f "$folder/share/java/lcm.jar" ] && return 0
    say "downloading lcm $wheel_version from PyPI (3 MB)"
    python3 -m pip download --quiet --no-deps --only-binary=:all: --python-version 3.11 --implementation cp \
        --platform manylinux_2_28_x86_64 --dest "$work" "lcm==$wheel_version"
    local wheel
    wheel=$(echo "$work"/lcm-*.whl)
    sha256sum --quiet --check - <<<"$wheel_sha256  $wheel" || fail "$wheel: SHA-256 differs from the pinned one"
    python3 -m zipfile --extract "$wheel" "$work/wheel"
    mkdir -p "$folder/bin" "$folder/share/java"
    install "$work/wheel/bin/lcm-spy" "$folder/bin/"
    rm -f "$work"/wheel/share/java/lcm-sources.jar
    install --mode 644 "$work"/wheel/share/java/*.jar "$folder/share/java/"
}

build_jar() {
    lcm-gen --java --jpath "$work/java" lcmtypes/*.lcm >/dev/null
    mkdir "$work/classes"
    # For any Java from version 8 on, without the compiler's warning that 8 is old.
    javac --release 8 -Xlint:-options -nowarn -cp "$folder/share/java/lcm.jar" -d "$work/classes" "$work"/java/hoofprint/*.java
    jar --create --file "$jar" -C "$work/classes" .
}

check_tools
fetch_spy
build_jar
say "types: $jar ($(jar --list --file "$jar" | grep -c '\.class$') classes)"
[ -e "$(dirname "$(realpath "$(command -v java)")")/../lib/libawt_xawt.so" ] \
    || say "this Java has no windows; install them: apt-get install default-jre"
say "start: CLASSPATH=$jar $folder/bin/lcm-spy"
