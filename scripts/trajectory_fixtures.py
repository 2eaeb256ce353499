#!/usr/bin/env python3
"""Time-optimal durations of motions with limited jerk, against which the on-line trajectory generator is tested.

    pip install ruckig numpy
    python3 scripts/trajectory_fixtures.py

writes controller/tests/data/trajectory_durations.json. Each case is [p, v, a, goal, v_max, a_max, j_max, duration], m and s; the motion ends at
rest in the goal. The first half starts at rest, the second half in a random state from which the velocity limit can be kept. Durations are from
Ruckig (Berscheid and Kröger 2021), another method than the generator's.
"""

import json
import pathlib

import numpy as np
import ruckig

OUT = pathlib.Path(__file__).resolve().parent.parent / "controller/tests/data/trajectory_durations.json"
CASES = 400


def main():
    rng = np.random.default_rng(1)
    cases = []
    while len(cases) < CASES:
        v_max, a_max, j_max = (float(10.0**x) for x in rng.uniform([-1, -0.5, 0], [0.5, 1, 2.5]))
        p, goal = (float(x) for x in rng.uniform(-1, 1, 2))
        v, a = 0.0, 0.0
        if len(cases) >= CASES // 2:
            v, a = (float(x) for x in rng.uniform(-1, 1, 2) * [v_max, a_max])
            if abs(v + a * abs(a) / (2 * j_max)) > v_max:
                continue
        inp = ruckig.InputParameter(1)
        inp.current_position, inp.current_velocity, inp.current_acceleration = [p], [v], [a]
        inp.target_position, inp.target_velocity, inp.target_acceleration = [goal], [0.0], [0.0]
        inp.max_velocity, inp.max_acceleration, inp.max_jerk = [v_max], [a_max], [j_max]
        trajectory = ruckig.Trajectory(1)
        if ruckig.Ruckig(1).calculate(inp, trajectory) != ruckig.Result.Working:
            continue
        cases.append([p, v, a, goal, v_max, a_max, j_max, trajectory.duration])
    rows = ",\n".join(json.dumps(case) for case in cases)
    OUT.write_text(f"[\n{rows}\n]\n")


main()
