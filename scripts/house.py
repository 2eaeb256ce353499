#!/usr/bin/env python3
"""Judges the source tree. Usage: see scripts/house.sh."""

import argparse
import json
import subprocess
import sys
import tomllib
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent


def row(name, wanted, measured, unit):
    """`wanted` is the largest value that passes. Without a measurement the row fails."""
    passes = measured is not None and measured <= wanted
    return {"name": name, "published": None, "wanted": f"<= {wanted}", "measured": measured, "unit": unit, "pass": passes}


def output(*command):
    """Standard output of a script that exits with 0 or, if it found something, with 1."""
    done = subprocess.run(command, cwd=TOP, capture_output=True, text=True)
    if done.returncode not in (0, 1) or not done.stdout:
        sys.exit(f"error: {' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def golden_changes(base):
    """Golden logs that differ from revision `base`, the working tree included."""
    done = subprocess.run(["git", "diff", "--name-only", base, "--", "logs/golden"], cwd=TOP, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"error: git diff {base}: {done.stderr.strip()}")
    return len(done.stdout.splitlines())


def minutes(path, name):
    """Minutes of the last `make NAME` if it passed on the present revision, else None."""
    last = json.loads(path.read_text()).get(name) if path.is_file() else None
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=TOP, capture_output=True, text=True).stdout.strip()
    return last["minutes"] if last and last["passed"] and head.startswith(last["revision"]) else None


def main():
    parser = argparse.ArgumentParser(description="Judges the source tree.")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--base", required=True, help="revision whose golden logs are compared, such as the last release")
    parser.add_argument("--target-dir", default="target", type=Path, help="folder of make_times.json (default target)")
    args = parser.parse_args()

    rows = [row("lines of README.md", 200, len((TOP / "README.md").read_text().splitlines()), "lines")]
    for crate in json.loads(output("scripts/circles.sh", "--json")):
        rows.append(row(f"largest import circle: {crate['crate']}", 3, crate["largest"], "files"))
    rows.append(row("old names and phrases", 0, json.loads(output("scripts/words.sh", "--json"))["hits"], "hits"))
    rows.append(row(f"golden logs that differ from {args.base}", 0, golden_changes(args.base), "files"))
    for task in tomllib.loads((TOP / "scripts/newcomer.toml").read_text())["task"]:
        files = {edit["file"] for edit in task["edit"]}
        rows.append(row(f"files touched: {task['name']}", 2, len(files), "files"))
    times = TOP / args.target_dir / "make_times.json"
    rows.append(row("make check, warm", 3, minutes(times, "check"), "min"))
    rows.append(row("make test", 30, minutes(times, "test"), "min"))

    if args.json:
        print(json.dumps(rows, indent=1))
    else:
        width = max(len(r["name"]) for r in rows)
        print(f"{'':{width}}  {'wanted':>8} {'measured':>9}  {'unit':5}  pass")
        for r in rows:
            measured = "-" if r["measured"] is None else r["measured"]
            print(f"{r['name']:{width}}  {r['wanted']:>8} {measured:>9}  {r['unit']:5}  {'yes' if r['pass'] else 'NO'}")
    sys.exit(0 if all(r["pass"] for r in rows) else 1)


if __name__ == "__main__":
    main()
