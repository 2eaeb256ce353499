#!/usr/bin/env bash
# Installs what cargo cannot: liblcm, a multicast route, libudev (gamepads), MuJoCo. With --tests also what only tests use: compilers and interpreters for
# stock LCM code, valgrind (counts instructions), qemu-user, Cyclone DDS (a peer) and public URDFs (166 MB are downloaded once).
# usage: scripts/setup.sh [--tests]
# Each step checks its result first, so a second run takes less than a second.
# Run as root or with sudo; otherwise the script prints the command to run as root.
set -euo pipefail
cd "$(dirname "$0")/.."
case "${1:-}" in
    "") for_tests=false ;;
    --tests) for_tests=true ;;
    *) echo "setup: unknown argument $1, expected none or --tests" >&2; exit 2 ;;
esac

mujoco_version=3.17.0
mujoco_wheel_sha256=d66928d86a2d1b601bbaa4dc11db50214d17d5301bb8afd84721313b67ff0874
mujoco_library_sha256=23496b023ee80fb61ab71167e94bc649f9941710fde96b18bb8204fb332523ad
mujoco_dir=third_party/mujoco
cyclonedds_version=11.0.1
cyclonedds_dir=third_party/cyclonedds
lcm_group=239.255.76.67

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }

# Runs a command as root, or fails and prints the command.
as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail "not root, and sudo not found; run as root, then start again: $*"
    fi
}

check_machine() {
    [ "$(uname -sm)" = "Linux x86_64" ] || fail "this machine is $(uname -sm); MuJoCo is pinned for Linux x86_64 only"
    PATH="$PATH:$HOME/.cargo/bin" command -v cargo >/dev/null \
        || fail "cargo not found; install Rust from https://rustup.rs (rust-toolchain.toml then picks the version)"
}

# Checks for the files themselves: another package may provide them.
install_packages() {
    local missing=()
    command -v cc >/dev/null || missing+=(gcc libc6-dev)
    liblcm_present || missing+=(liblcm-dev)
    command -v lcm-logger >/dev/null || missing+=(liblcm-bin)
    pkg-config --exists libudev 2>/dev/null || missing+=(pkg-config libudev-dev)
    command -v ip >/dev/null || missing+=(iproute2)
    mujoco_present || python3 -m pip --version >/dev/null 2>&1 || missing+=(python3 python3-pip)
    if "$for_tests"; then
        # Compilers and interpreters for the stock LCM code in tests/stock.
        command -v g++ >/dev/null || missing+=(g++)
        lua5.2 -e 'require("lcm")' 2>/dev/null || missing+=(lua5.2 liblcm-lua)
        [ -f /usr/share/java/lcm.jar ] || missing+=(liblcm-java)
        command -v valgrind >/dev/null || missing+=(valgrind)
        command -v qemu-x86_64 >/dev/null || missing+=(qemu-user)
        python3 -m pip --version >/dev/null 2>&1 || missing+=(python3 python3-pip)
    fi
    [ ${#missing[@]} -gt 0 ] || return 0

    command -v apt-get >/dev/null || fail "apt-get not found; install these Debian packages: ${missing[*]}"
    say "installing ${missing[*]}"
    local install=(env DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends "${missing[@]}")
    # The first attempt fails if package lists are missing or old.
    as_root "${install[@]}" || { as_root apt-get update && as_root "${install[@]}"; }
}

liblcm_present() {
    cc -x c - -o /dev/null -llcm 2>/dev/null <<<$'#include <lcm/lcm.h>\nint main(void) { return 0; }'
}

# liblcm refuses to start without a route for its multicast group. Lockstep runs need no route, so this step only warns.
add_multicast_route() {
    ip route get "$lcm_group" >/dev/null 2>&1 && return 0
    say "no route to $lcm_group: adding 224.0.0.0/4 on the loopback interface"
    (as_root ip link set lo up && as_root ip route add 224.0.0.0/4 dev lo) \
        || say "could not add the route: lockstep runs work, live runs over LCM will not"
}

mujoco_present() {
    local library="$mujoco_dir/lib/libmujoco.so.$mujoco_version"
    [ -f "$mujoco_dir/include/mujoco/mujoco.h" ] && [ -e "$mujoco_dir/lib/libmujoco.so" ] && [ -f "$library" ] \
        && sha256sum --status --check <<<"$mujoco_library_sha256  $library"
}

install_mujoco() {
    mujoco_present && return 0
    local wheel
    mkdir -p third_party
    work=$(mktemp -d third_party/.mujoco.XXXXXX)
    trap 'rm -rf "$work"' EXIT

    say "downloading MuJoCo $mujoco_version (27 MB)"
    python3 -m pip download --no-deps --only-binary=:all: --python-version 3.11 --implementation cp \
        --platform manylinux_2_28_x86_64 --dest "$work" "mujoco==$mujoco_version"
    wheel=$(echo "$work"/mujoco-*.whl)
    sha256sum --check - <<<"$mujoco_wheel_sha256  $wheel" || fail "$wheel: SHA-256 differs from the pinned one"

    python3 - "$wheel" "$work/mujoco" <<'PYTHON'
import pathlib, sys, zipfile

wheel, target = sys.argv[1], pathlib.Path(sys.argv[2])
with zipfile.ZipFile(wheel) as archive:
    for name in archive.namelist():
        if name.startswith("mujoco/libmujoco.so"):
            path = target / "lib" / pathlib.PurePath(name).name
        elif name.startswith("mujoco/include/mujoco/") and name.endswith(".h"):
            path = target / "include" / "mujoco" / pathlib.PurePath(name).name
        else:
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(archive.read(name))
PYTHON
    ln -s "libmujoco.so.$mujoco_version" "$work/mujoco/lib/libmujoco.so"
    rm -rf "$mujoco_dir"
    mv "$work/mujoco" "$mujoco_dir"
    mujoco_present || fail "$mujoco_dir is incomplete after unpacking"
}

cyclonedds_present() {
    [ -d "$cyclonedds_dir/cyclonedds-$cyclonedds_version.dist-info" ] \
        && PYTHONPATH="$cyclonedds_dir" python3 -c 'import cyclonedds.domain' 2>/dev/null
}

# Only tests/bridge.rs needs it; its optional dependency for a command line is left out.
install_cyclonedds() {
    cyclonedds_present && return 0
    say "downloading Cyclone DDS $cyclonedds_version (8 MB)"
    rm -rf "$cyclonedds_dir"
    python3 -m pip install --quiet --root-user-action=ignore --no-deps --only-binary=:all: --require-hashes --target "$cyclonedds_dir" \
        --requirement scripts/cyclonedds.txt
    cyclonedds_present || fail "$cyclonedds_dir: python3 cannot import it"
}

check_machine
install_packages
add_multicast_route
install_mujoco
ready="liblcm, MuJoCo $mujoco_version"
if "$for_tests"; then
    install_cyclonedds
    "$PWD/scripts/fetch_robots.sh" "${CARGO_TARGET_DIR:-target}/robots" || say "no public URDFs: the tests public_urdfs and public_srdfs will fail"
    ready+=", Cyclone DDS $cyclonedds_version"
fi
say "ready: $ready"
