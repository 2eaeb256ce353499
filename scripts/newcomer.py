#!/usr/bin/env python3
"""Makes each typical change of scripts/newcomer.toml in a copy of the source tree and compiles it. Usage: see scripts/newcomer.sh."""

import argparse
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", TOP / "target")).resolve()


def copy(tree):
    """The files under version control; unchanged files keep their time, so cargo compiles only what changed."""
    names = subprocess.run(["git", "ls-files"], cwd=TOP, check=True, capture_output=True, text=True).stdout.splitlines()
    for name in names:
        source, target = TOP / name, tree / name
        if source.is_file() and not name.startswith("logs/") and (not target.is_file() or target.read_bytes() != source.read_bytes()):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
    if not (tree / "third_party").exists():
        (tree / "third_party").symlink_to(TOP / "third_party")


def apply(task, tree):
    """Applies the edits of a task; returns the files with their content before, None for a new file."""
    before = {}
    for edit in task["edit"]:
        path = tree / edit["file"]
        text = path.read_text() if path.is_file() else None
        before.setdefault(path, text)
        if "from" not in edit:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(edit["to"].lstrip())
            continue
        found = (text or "").count(edit["from"])
        if found != 1:
            restore(before)
            sys.exit(f"error: {task['name']}: {edit['file']} contains {edit['from']!r} {found} times, expected once")
        path.write_text(text.replace(edit["from"], edit["to"]))
    return before


def restore(before):
    for path, text in before.items():
        if text is None:
            path.unlink()
        else:
            path.write_text(text)


def main():
    parser = argparse.ArgumentParser(description="Makes each change of scripts/newcomer.toml in a copy of the source tree and compiles it.")
    parser.add_argument("--only", default="", help="only tasks whose name contains this text")
    parser.add_argument("--edits", action="store_true", help="only check that each edit still applies; compile nothing")
    args = parser.parse_args()
    tree, failed = TARGET / "newcomer", False
    copy(tree)
    for task in tomllib.loads((TOP / "scripts/newcomer.toml").read_text())["task"]:
        if args.only not in task["name"]:
            continue
        before = apply(task, tree)
        if args.edits:
            restore(before)
            continue
        try:
            # A target directory of its own: cargo cannot distinguish the copy's packages from those of the checkout.
            check = ["cargo", "check", "--quiet", "--locked", "--target-dir", TARGET / "newcomer_target", "--package", task["package"]]
            done = subprocess.run(check, cwd=tree, capture_output=True, text=True)
        finally:
            restore(before)
        compiled = done.returncode == 0
        failed |= not compiled
        files = sorted({edit["file"] for edit in task["edit"]})
        print(f"{'compiles' if compiled else 'FAILS   '} {task['name']}: {len(files)} files: {', '.join(files)}", flush=True)
        if not compiled:
            print(done.stderr, file=sys.stderr)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
