#!/usr/bin/env python3
"""Writes the expected values of the test `public_urdfs` of robot-model, computed by Pinocchio.

    pip install pin==4.1.0
    scripts/fetch_robots.sh && python3 scripts/urdf_fixtures.py

makes controller/model/tests/data/public_urdfs.json from every URDF below target/robots that Pinocchio reads. For each file:

- `joints`: number of movable joints, `floating`: whether the base floats (a floating joint in the file);
- `times`: the products M x1 and M x2 of the mass matrix with two vectors, one number a row. A wrong entry of M changes them.

Configuration and vectors are closed forms of the index. Joint i, from 0 in the order of the file: q_i = 0.1 + 0.07 (i mod 11). The base is at the
origin. Row k of v = [v_WB; w_WB; qd]: x1_k = (37 k mod 101) / 100 - 0.5, x2_k = (53 k mod 101) / 100 - 0.5.
"""

import json
import multiprocessing
import pathlib
import xml.parsers.expat

import numpy as np
import pinocchio as pin

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROBOTS = ROOT / "target/robots"
OUT = ROOT / "controller/model/tests/data/public_urdfs.json"


def joints_of(path):
    """Name and type of each `<joint>` of the robot, in the order of the file. Prefixes of names need no declaration."""
    joints, depth = [], 0

    def start(name, attributes):
        nonlocal depth
        depth += 1
        if depth == 2 and name == "joint":
            joints.append((attributes["name"], attributes["type"]))

    def end(_):
        nonlocal depth
        depth -= 1

    parser = xml.parsers.expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(path.read_bytes().lstrip(), True)
    return joints


def expected(path):
    """The expected values of one file, or `None` if Pinocchio does not read it."""
    try:
        model = pin.buildModelFromUrdf(str(path))
    except ValueError:
        return None
    movable = [name for name, kind in joints_of(path) if kind not in ("fixed", "floating")]
    free = [joint for joint in model.joints if joint.shortname() == "JointModelFreeFlyer"]
    q = pin.neutral(model)
    order = list(range(free[0].idx_v, free[0].idx_v + 6)) if free else []
    for i, name in enumerate(movable):
        joint = model.joints[model.getJointId(name)]
        x = 0.1 + 0.07 * (i % 11)
        q[joint.idx_q : joint.idx_q + joint.nq] = [x] if joint.nq == 1 else [np.cos(x), np.sin(x)]
        order.append(joint.idx_v)
    M = pin.crba(model, model.createData(), q)
    M = (np.triu(M) + np.triu(M, 1).T)[np.ix_(order, order)]
    k = np.arange(len(order))
    times = [(M @ ((factor * k % 101) / 100 - 0.5) + 0.0).tolist() for factor in (37, 53)]
    file = str(path.relative_to(ROBOTS))
    return {"file": file, "joints": len(movable), "floating": bool(free), "times": times}


def main():
    files = sorted(ROBOTS.rglob("*.urdf"))
    with multiprocessing.Pool(1, maxtasksperchild=20) as pool:
        robots = pool.map(expected, files, chunksize=1)
    lines = ",\n".join(json.dumps(robot, separators=(",", ":")) for robot in robots if robot)
    made_by = f"scripts/urdf_fixtures.py with Pinocchio {pin.__version__}"
    OUT.write_text(f'{{"made_by":"{made_by}","robots":[\n{lines}\n]}}\n')
    print(f"{OUT}: {len(files)} files, {sum(robot is not None for robot in robots)} read by Pinocchio")


if __name__ == "__main__":
    main()
