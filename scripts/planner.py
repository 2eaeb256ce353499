#!/usr/bin/env python3
"""A planner in Python: sends JOINT_REFERENCE to a live run, which moves its joints there. Any program that sends LCM messages can take part like this.

The component of the run file that it plays (runs/centauro_external.toml):

    [[component]]
    name = "script"
    kind = "external"

    [[component]]
    name = "arms"
    kind = "posture"
    receives = ["script/JOINT_REFERENCE"]

Needs the PyPI package `lcm` and the Python types of the messages:

    python3 -m pip install lcm
    mkdir -p /tmp/types && lcm-gen --python --ppath /tmp/types lcmtypes/*.lcm
    PYTHONPATH=/tmp/types python3 scripts/planner.py script j_arm1_4=-1.4 j_arm2_4=-1.4

What the run consumed of it is in the log, so the run replays bit for bit without this script.
"""

import argparse
import time

import lcm
from hoofprint import joint_reference_t

PERIOD_S = 0.1


def goal(text):
    """`JOINT=POSITION` as a pair."""
    name, _, position = text.partition("=")
    return name, float(position)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("component", help="name of the component in the run file")
    parser.add_argument("goals", nargs="+", type=goal, metavar="JOINT=POSITION", help="position of a joint, rad or m")
    parser.add_argument("--lcm-url", default="udpm://239.255.76.67:7667?ttl=0", help="network of the run")
    parser.add_argument("--seconds", type=float, default=5.0, help="time for which it sends [default: 5]")
    args = parser.parse_args()

    network = lcm.LCM(args.lcm_url)
    message = joint_reference_t()
    message.joints = [name for name, _ in args.goals]
    message.q = [position for _, position in args.goals]
    message.n = len(args.goals)
    end = time.monotonic() + args.seconds
    while time.monotonic() < end:
        message.t_ns = time.monotonic_ns()
        network.publish(f"{args.component}/JOINT_REFERENCE", message.encode())
        message.seq += 1
        time.sleep(PERIOD_S)
    print(f"{message.seq} messages sent")


if __name__ == "__main__":
    main()
