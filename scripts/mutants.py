#!/usr/bin/env python3
"""Changes one line of the controller, builds the replay, and replays an unchanged log: is the change found in the expected stage and at the expected tick?

    scripts/mutants.py HOOF [--only TEXT] [--golden] [--markdown docs/mutants.md]

HOOF records the log, 2 s of HyQ on stones; the mutants are in mutants.toml. Those with `golden = true` are searched with the golden logs. The expected tick of each is computed from the log by rules that use no
replay. Builds are in $CARGO_TARGET_DIR/mutants (or target/mutants). Exit code 1 if a mutant is not found at the expected place.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORK = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve() / "mutants"
TREE, CORPUS, LOG = WORK / "tree", WORK / "corpus", WORK / "run.mcap"
GOLDEN = ROOT / "logs/golden"


def ticks(hoof):
    """First tick of each kind that mutants.toml names."""
    channels = "CONTROLLER_INPUT|LEG_STATE|WBC_SOLUTION|ROBOT_COMMAND"
    text = subprocess.run([hoof, "log", "cat", "--json", "--channels", channels, LOG], check=True, capture_output=True, text=True).stdout
    messages = {}
    for line in text.splitlines():
        event = json.loads(line)
        messages.setdefault(event["channel"], []).append(event["fields"])

    def first(channel, holds):
        return next(m["tick"] for m in messages[channel] if holds(m))

    def orientation(m):
        return next(d["data"]["q_WI_wxyz"] for d in m["messages"] if d["channel"] == "ROBOT_STATE")

    start = orientation(messages["CONTROLLER_INPUT"][0])
    lift_off = first("LEG_STATE", lambda m: any(m["state"]))
    return {
        "start": 0,
        "swing": first("LEG_STATE", lambda m: any(t > 0 for t in m["t_swing"])),
        "swing+2": lift_off + 2,
        # Every iteration adds a row to the working set or removes one.
        "release": first("WBC_SOLUTION", lambda m: m["iterations"] > m["n_active"]),
        "tilt": first("CONTROLLER_INPUT", lambda m: orientation(m) != start),
        "clamps": first("WBC_SOLUTION", lambda m: m["n_clamped"] > 0),
        "moves": first("ROBOT_COMMAND", lambda m: any(m["qd_des"])),
    }


def mirror():
    """Copies the sources. Unchanged files keep their time, so cargo builds only what changed."""
    names = subprocess.run(["git", "-C", ROOT, "ls-files"], check=True, capture_output=True, text=True).stdout.splitlines()
    for name in names:
        source, copy = ROOT / name, TREE / name
        if not source.is_file() or name.startswith(("logs/", "docs/")):
            continue
        if not copy.is_file() or copy.read_bytes() != source.read_bytes():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, copy)


def replay(corpus=CORPUS):
    """Builds the tree and replays the logs of a corpus; returns the results of `replay_golden --json`."""
    build = ["cargo", "build", "--quiet", "--release", "--package", "replay", "--example", "replay_golden", "--target-dir", WORK / "target"]
    environment = {**os.environ, "CARGO_INCREMENTAL": "1", "RUSTFLAGS": "-Awarnings"}
    subprocess.run(build, check=True, cwd=TREE, env=environment)
    done = subprocess.run([WORK / "target/release/examples/replay_golden", corpus, "--json"], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("hoof", type=Path, help="the command to record with, such as target/release/hoof")
    arguments.add_argument("--only", default="", help="only mutants whose description contains this text")
    arguments.add_argument("--golden", action="store_true", help="only mutants that are searched with the golden logs")
    arguments.add_argument("--markdown", type=Path, help="write the table of results here")
    args = arguments.parse_args()
    hoof = args.hoof.resolve()
    shutil.rmtree(CORPUS, ignore_errors=True)
    CORPUS.mkdir(parents=True)
    run = lambda *arguments: subprocess.run([hoof, *arguments], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    run("sim", "--robot", "hyq", "--scenario", "scenarios/short_rough.toml", "--log", LOG)
    run("corpus", "add", LOG, "--name", "run", "--why", "mutants", "--keep", "all", "--dir", CORPUS)
    mirror()
    for result in replay() + replay(GOLDEN):
        if not result["identical"]:
            sys.exit(f"error: without a mutant a log does not replay: {result}")

    expected = ticks(hoof)
    mutants = tomllib.loads((ROOT / "scripts/mutants.toml").read_text())["mutant"]
    rows, golden_rows, failed = [], [], False
    for mutant in (m for m in mutants if args.only in m["what"] and (m.get("golden") or not args.golden)):
        file = TREE / mutant["file"]
        text = file.read_text()
        if text.count(mutant["from"]) != 1:
            sys.exit(f"error: {mutant['file']}: \"{mutant['from']}\" occurs {text.count(mutant['from'])} times, expected once")
        file.write_text(text.replace(mutant["from"], mutant["to"]))
        golden = mutant.get("golden", False)
        try:
            results = replay(GOLDEN if golden else CORPUS)
        finally:
            file.write_text(text)
        if golden:
            found_by = [result["name"] for result in results if not result["identical"]]
            failed |= not found_by
            print(f"{'found ' if found_by else 'MISSED'} {mutant['what']}: {', '.join(found_by)}", flush=True)
            golden_rows.append((mutant, found_by))
            continue
        result = results[0]
        found = result["first_divergence"]
        place = (found["tick"], found["stage"], f"{found['channel']} {found['field']}") if found else None
        wanted = (expected[mutant["tick"]], mutant["stage"], mutant["shows"])
        seen = ", ".join(f"{also['channel']} {also['field']}" for also in found["also"]) if found else ""
        good = place == wanted and mutant.get("also", "") in seen
        failed |= not good
        print(f"{'found ' if good else f'MISSED, expected {wanted}:'} {mutant['what']}: {place}", flush=True)
        rows.append((mutant, place, seen, good))
    if args.markdown:
        args.markdown.write_text(table(rows, golden_rows))
    sys.exit(failed)


def table(rows, golden_rows):
    """The results as a page."""
    lines = [
        "# Mutants of the controller",
        "",
        "One line of the controller is changed; everything else stays. At which tick, stage and field does the replay of an unchanged log differ first? Made by",
        "`scripts/mutants.py target/release/hoof --markdown docs/mutants.md`: 2 s of HyQ on stones with all outputs kept. The expected tick is computed from the",
        "log by rules that use no replay (`scripts/mutants.toml`).",
        "",
        "| stage | mutant | line | expected | first difference | also different |",
        "|---|---|---|---|---|---|",
    ]
    for mutant, place, seen, good in rows:
        where = f"`{Path(mutant['file']).name}`: `{mutant['to']}`"
        found = f"{place[1]}, tick {place[0]}, {place[2]}" if place else "nowhere"
        lines.append(
            f"| {mutant['stage']} | {mutant['what']} | {where} | {mutant['tick']} | {found}{'' if good else ' **(missed)**'} | {seen} |".replace("| |", "| - |")
        )
    if golden_rows:
        lines += ["", "Found by a replay of the golden logs:", "", "| mutant | line | golden logs that differ |", "|---|---|---|"]
    for mutant, found_by in golden_rows:
        line = f"`{Path(mutant['file']).name}`: `{mutant['to'].strip().splitlines()[-1].strip()}`"
        lines.append(f"| {mutant['what']} | {line} | {', '.join(found_by) or '**none (missed)**'} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
