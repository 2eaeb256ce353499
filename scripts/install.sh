#!/usr/bin/env bash
# Installs the command and what it needs below PREFIX (default /usr/local, or ~/.local for a user that may not write there):
#   bin/hoof, lib/hoofprint/libmujoco.so.*, share/hoofprint/{robots,gaits,scenarios,runs,stacks}, shell completions and manual pages.
# usage: scripts/install.sh HOOF [PREFIX]        HOOF: the built command, such as target/release/hoof
# The installed command needs no checkout. Debian's liblcm stays where scripts/setup.sh has installed it.
set -euo pipefail
hoof=$(realpath "${1:?usage: scripts/install.sh HOOF [PREFIX]}")
default=/usr/local
[ -w "$default/bin" ] || default=$HOME/.local
prefix=$(realpath --canonicalize-missing "${2:-$default}")
cd "$(dirname "$0")/.."

install -D --mode 755 "$hoof" "$prefix/bin/hoof"
for library in third_party/mujoco/lib/libmujoco.so.*; do
    install -D --mode 644 "$library" "$prefix/lib/hoofprint/$(basename "$library")"
done
# Only files under version control: a checkout may contain logs and drafts.
git ls-files -z -- robots gaits scenarios runs stacks | while IFS= read -r -d '' file; do
    install -D --mode 644 "$file" "$prefix/share/hoofprint/$file"
done
"$prefix/bin/hoof" install-files --prefix "$prefix" >/dev/null
echo "installed $("$prefix/bin/hoof" --version) in $prefix"
case ":$PATH:" in
    *":$prefix/bin:"*) ;;
    *) echo "$prefix/bin is not in PATH: run  export PATH=\"$prefix/bin:\$PATH\"" ;;
esac
