#!/usr/bin/env python3
"""Lists the pairs of links whose shapes touch in a named posture, of the robots whose shapes are our own. Exit code 1 if there is one.

    pip install pin==4.1.0
    python3 scripts/self_contact.py

Links of one body, of neighbouring bodies, and the pairs of `[robot.disabled_collisions]` are not compared.
"""

import pathlib
import sys
import tomllib

import numpy as np
import pinocchio as pin

ROBOTS = pathlib.Path(__file__).resolve().parent.parent / "robots"


def touching(folder):
    """Posture, link, link, distance in m of each pair that touches; number of compared pairs."""
    name = folder.name
    robot = tomllib.loads((folder / f"{name}.toml").read_text())["robot"]
    urdf = str(folder / robot["urdf"])
    model = pin.buildModelFromUrdf(urdf, pin.JointModelFreeFlyer())
    shapes = pin.buildGeomFromUrdf(model, urdf, pin.GeometryType.COLLISION)
    joints = [shape.parentJoint for shape in shapes.geometryObjects]
    links = [model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
    disabled = {frozenset((link, other)) for link, others in robot.get("disabled_collisions", {}).items() for other in others}
    pairs = 0
    for a in range(len(joints)):
        for b in range(a):
            near = joints[a] == joints[b] or model.parents[joints[a]] == joints[b] or model.parents[joints[b]] == joints[a]
            if not near and frozenset((links[a], links[b])) not in disabled:
                shapes.addCollisionPair(pin.CollisionPair(b, a))
                pairs += 1
    data, geometry = model.createData(), shapes.createData()
    found = []
    for posture, positions in (robot.get("postures") or {"nominal": robot["posture"]}).items():
        q = pin.neutral(model)
        for joint, value in positions.items():
            at = model.joints[model.getJointId(joint)]
            q[at.idx_q : at.idx_q + at.nq] = [value] if at.nq == 1 else [np.cos(value), np.sin(value)]
        pin.computeDistances(model, data, shapes, geometry, q)
        for pair, distance in zip(shapes.collisionPairs, geometry.distanceResults):
            if distance.min_distance <= 0.0:
                names = [shapes.geometryObjects[k].name for k in (pair.first, pair.second)]
                found.append((posture, *names, distance.min_distance))
    return found, pairs


def main():
    bad = 0
    for folder in sorted(path for path in ROBOTS.iterdir() if path.is_dir()):
        if "scripts/robot_urdf.py" not in (folder / "SOURCES").read_text() and folder.name != "hyq":
            continue
        found, pairs = touching(folder)
        print(f"{folder.name}: {pairs} pairs, {len(found)} touch")
        for posture, a, b, distance in found:
            print(f"  {posture}: {a}, {b}: {distance:.4f} m")
        bad += len(found)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
