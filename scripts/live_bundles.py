#!/usr/bin/env python3
"""Bundles of live logs replay: records live runs, cuts out bundles around random times with `hoof log trim --around`, and replays each.

    scripts/live_bundles.py HOOF [--runs 2] [--bundles 20] [--seconds 20] [--seed 1]

Each run is HyQ in simulation, as processes over LCM. Prints one judged row as JSON. Exit code 1 if a bundle does not replay with exit code 0.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
URL = "udpm://239.255.76.67:7693?ttl=0"
SCENARIOS = ["flat_trot", "rough_trot"]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("hoof", type=Path, help="the command, such as target/release/hoof")
    arguments.add_argument("--runs", type=int, default=2, help="live runs")
    arguments.add_argument("--bundles", type=int, default=20, help="bundles in all")
    arguments.add_argument("--seconds", type=float, default=20.0, help="length of a run")
    arguments.add_argument("--seed", type=int, default=1, help="seed of the random times")
    args = arguments.parse_args()
    hoof, times, good = args.hoof.resolve(), random.Random(args.seed), 0

    def run(*words):
        return subprocess.run([hoof, *map(str, words)], cwd=ROOT, capture_output=True, text=True)

    with tempfile.TemporaryDirectory() as folder:
        for k in range(args.bundles):
            number = k * args.runs // args.bundles
            log, bundle = Path(folder, f"run{number}.mcap"), Path(folder, "bundle.mcap")
            if not log.exists():
                scenario = f"scenarios/{SCENARIOS[number % len(SCENARIOS)]}.toml"
                run("run", "runs/hyq_sim.toml", "--scenario", scenario, "--seconds", args.seconds, "--log", log, "--lcm-url", URL)
                info = json.loads(run("log", "info", log, "--json").stdout)["runs"][0]
                length_s = (info["last_t_ns"] - info["first_t_ns"]) / 1e9
            at = times.uniform(0.0, length_s)
            bundle.unlink(missing_ok=True)
            trimmed = run("log", "trim", log, bundle, "--around", f"{at:.3f}")
            replayed = run("replay", bundle, "--json")
            codes = (trimmed.returncode, replayed.returncode)
            good += codes == (0, 0)
            said = "" if codes == (0, 0) else f": {trimmed.stderr}{replayed.stdout}{replayed.stderr}"
            print(f"{log.name} at {at:.3f} s: exit codes {codes}{said}", file=sys.stderr, flush=True)
    name = f"bundles of {args.runs} live runs that replay with exit code 0"
    is_good = good == args.bundles
    print(json.dumps({"name": name, "published": None, "wanted": str(args.bundles), "measured": good, "unit": "", "pass": is_good}))
    sys.exit(not is_good)


main()
