#!/usr/bin/env python3
"""Writes the expected values of the contact tests, computed by Pinocchio and by numerical differences.

    pip install pin==4.1.0
    python3 scripts/contact_fixtures.py

makes controller/tests/data/contacts.json: wheels of Centauro at random states, on surfaces with random normals, each with

- p_WC: the point of the rim that is lowest along the normal, found by a search over the rim,
- velocity: of the point of the wheel that is there, from Pinocchio's velocity of the link,
- jacobian: of that velocity, over v = [v_WB; w_WB; qd],
- bias: derivative of that velocity along the motion with constant v, by differences of fourth order; the point of the rim is searched at each time.
"""

import json
import pathlib

import numpy as np
import pinocchio as pin
from pinocchio_fixtures import ROOT, WORLD, Robot, plain

RADIUS = 0.078
AXIS = np.array([0.0, 0.0, 1.0])
STEP = 2e-4


def lowest_point(R, n):
    """Lever from the centre to the lowest point of the rim, by a search over the angle."""
    e1 = np.array([1.0, 0.0, 0.0])
    e2 = np.cross(AXIS, e1)
    point = lambda angle: R @ (RADIUS * (np.cos(angle) * e1 + np.sin(angle) * e2))
    height = lambda angle: n @ point(angle)
    angles = np.linspace(0, 2 * np.pi, 361)
    angle = angles[np.argmin([height(angle) for angle in angles])]
    # Newton's method: the second derivative of the height is its negative.
    for _ in range(8):
        slope = n @ R @ (RADIUS * (-np.sin(angle) * e1 + np.cos(angle) * e2))
        angle += slope / height(angle)
    return point(angle)


def velocity(robot, state, link, n):
    q, v, X = robot.to_pinocchio(state)
    model, data = robot.model, robot.data
    pin.computeJointJacobians(model, data, q)
    pin.forwardKinematics(model, data, q, v)
    pin.updateFramePlacements(model, data)
    frame = model.getFrameId(link, pin.FrameType.BODY)
    placement = data.oMf[frame]
    r = lowest_point(placement.rotation, n)
    twist = pin.getFrameVelocity(model, data, frame, WORLD)
    J = pin.getFrameJacobian(model, data, frame, WORLD) @ X
    return placement.translation + r, twist.linear + np.cross(twist.angular, r), J[:3] - pin.skew(r) @ J[3:]


def moved(state, t):
    R = pin.exp3(np.array(state["w_WB_W"]) * t) @ np.array(state["R_WB"])
    p = np.array(state["p_WB"]) + np.array(state["v_WB"]) * t
    return state | {"p_WB": p, "R_WB": R, "q": np.array(state["q"]) + np.array(state["qd"]) * t}


def main():
    rng = np.random.default_rng(20261130)
    robot = Robot(ROOT / "robots/centauro/centauro.urdf", True)
    cases = []
    for link in ["wheel_1", "wheel_2", "wheel_4"]:
        state = robot.random_state(rng)
        n = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.4, 0.4, 3)
        n /= np.linalg.norm(n)
        p, v, J = velocity(robot, state, link, n)
        at = lambda t: velocity(robot, moved(state, t), link, n)[1]
        bias = (8 * (at(STEP) - at(-STEP)) - (at(2 * STEP) - at(-2 * STEP))) / (12 * STEP)
        del state["vd"]
        expected = {"p_WC": p, "velocity": v, "jacobian": J, "bias": bias}
        cases.append({"link": link, "n_W": plain(n), "state": plain(state), "expected": plain(expected)})
    content = {"made_by": f"scripts/contact_fixtures.py with Pinocchio {pin.__version__}", "cases": cases}
    with open(pathlib.Path(ROOT) / "controller/tests/data/contacts.json", "w") as file:
        json.dump(content, file, separators=(",", ":"))
        file.write("\n")


if __name__ == "__main__":
    main()
