#!/usr/bin/env python3
"""Writes the expected values of the rigid-body model's tests, computed by Pinocchio.

    pip install pin==4.1.0
    python3 scripts/pinocchio_fixtures.py

makes controller/model/tests/data/{hyq,anymal_b,arm,centauro,coman_plus,coman,centauro_upper}.json from the URDFs in this repository, a few random states each. Everything is
converted to this project's conventions:

- v = [v_WB; w_WB; qd], base parts in W axes. Pinocchio has the base twist in base axes and sorts joints by name, so with
  v_pin = X v, X = blkdiag(R_WB^T, R_WB^T, P):  M = X^T M_pin X, J = J_pin X, h = X^T (h_pin + M_pin Xd v), where Xd v comes from
  the derivative of R_WB^T v_WB: vd_pin = X vd - [w_B x v_B; 0; 0].
- Accelerations are classical: of the origin of the frame, in W axes, without gravity.
- Floats are written by repr, so they come back bit for bit.
"""

import json
import pathlib
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin

ROOT = pathlib.Path(__file__).resolve().parent.parent
DATA = ROOT / "controller/model/tests/data"
# Name, URDF, whether the base floats, number of states, and the links whose frames are compared: all, or those with contacts and sensors.
ROBOTS = [
    ("hyq", ROOT / "robots/hyq/hyq.urdf", True, 6, None),
    ("anymal_b", ROOT / "robots/anymal_b/anymal_b.urdf", True, 6, None),
    ("arm", DATA / "arm.urdf", False, 6, None),
    ("centauro", ROOT / "robots/centauro/centauro.urdf", True, 2, ["imu_link", "wheel_1", "wheel_4", "ft_arm1", "arm2_8"]),
    ("coman_plus", ROOT / "robots/coman_plus/coman_plus.urdf", True, 2, ["imu_link", "l_sole", "r_sole", "TCP_L", "r_leg_ft"]),
    ("coman", ROOT / "robots/coman/coman.urdf", True, 2, ["imu_link", "l_sole", "r_sole", "LSoftHand", "r_leg_ft"]),
    ("centauro_upper", ROOT / "robots/centauro_upper/centauro_upper.urdf", False, 2, ["imu_link", "torso_2", "ft_arm1", "arm1_8", "arm2_8"]),
]
# The last state is far from the origin and fast: only the position itself may lose digits there.
FAR = np.array([8e2, -5e2, 60.0])
FAST = np.array([-15.0, 20.0, 3.0])
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def joints_in_file_order(path):
    """Names of the movable joints in the order of the file."""
    joints = ElementTree.parse(path).getroot().findall("joint")
    return [j.get("name") for j in joints if j.get("type") != "fixed"]


def links_in_file_order(path):
    return [link.get("name") for link in ElementTree.parse(path).getroot().findall("link")]


def random_rotation(rng):
    q = rng.normal(size=4)
    return pin.Quaternion(q / np.linalg.norm(q)).toRotationMatrix()


class Robot:
    """One model, and the map from this project's state to Pinocchio's."""

    def __init__(self, path, floating):
        root = [pin.JointModelFreeFlyer()] if floating else []
        self.model = pin.buildModelFromUrdf(str(path), *root)
        self.model.gravity.linear = np.array([0.0, 0.0, -9.81])
        self.data = self.model.createData()
        self.path = path
        self.floating = floating
        self.joints = joints_in_file_order(path)
        self.links = links_in_file_order(path)
        self.nb = 6 if floating else 0

    def to_pinocchio(self, state):
        """Configuration, velocity, and X with v_pin = X v."""
        q = pin.neutral(self.model)
        X = np.zeros((self.model.nv, self.model.nv))
        if self.floating:
            R = np.array(state["R_WB"])
            q[:3] = state["p_WB"]
            q[3:7] = pin.Quaternion(R).coeffs()
            X[:3, :3] = X[3:6, 3:6] = R.T
        for i, name in enumerate(self.joints):
            joint = self.model.joints[self.model.getJointId(name)]
            angle = state["q"][i]
            q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            X[joint.idx_v, self.nb + i] = 1.0
        v = np.concatenate([state["v_WB"], state["w_WB_W"], state["qd"]]) if self.floating else np.array(state["qd"])
        return q, X @ v, X

    def drift(self, v_pin):
        """vd_pin - X vd: the term from rotating base axes."""
        drift = np.zeros(self.model.nv)
        if self.floating:
            drift[:3] = -np.cross(v_pin[3:6], v_pin[:3])
        return drift

    def expected(self, state):
        model, data = self.model, self.data
        q, v, X = self.to_pinocchio(state)
        drift = self.drift(v)

        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        h = pin.rnea(model, data, q, v, drift)
        g = pin.computeGeneralizedGravity(model, data, q)
        out = {
            "mass_matrix": X.T @ M @ X,
            "bias_force": X.T @ h,
            "gravity_force": X.T @ g,
            "rnea": X.T @ pin.rnea(model, data, q, v, X @ np.array(state["vd"]) + drift),
        }

        G = pin.computeGeneralizedGravityDerivatives(model, data, q)
        out["gravity_derivative"] = (X.T @ G @ X)[self.nb :, self.nb :]

        out |= self.centroidal(state)

        pin.computeJointJacobians(model, data, q)
        pin.forwardKinematics(model, data, q, v, drift)
        pin.updateFramePlacements(model, data)
        out["frames"] = {}
        for link in self.links:
            frame = model.getFrameId(link, pin.FrameType.BODY)
            placement = data.oMf[frame]
            velocity = pin.getFrameVelocity(model, data, frame, WORLD)
            acceleration = pin.getFrameClassicalAcceleration(model, data, frame, WORLD)
            out["frames"][link] = {
                "p_WF": placement.translation.copy(),
                "R_WF": placement.rotation.copy(),
                "v_WF": velocity.linear.copy(),
                "w_WF_W": velocity.angular.copy(),
                "jacobian": pin.getFrameJacobian(model, data, frame, WORLD) @ X,
                "bias_acceleration": acceleration.vector.copy(),
            }
        return out

    def centroidal(self, state):
        """Centre of mass and momentum of all links.

        Pinocchio ignores the root link of a fixed base, so this function uses a free base at rest.
        """
        if not self.floating:
            rest = {"p_WB": np.zeros(3), "R_WB": np.eye(3), "v_WB": np.zeros(3), "w_WB_W": np.zeros(3)}
            free = Robot(self.path, True).centroidal(rest | state)
            return {key: value[:, 6:] if value.ndim == 2 else value for key, value in free.items()}
        model, data = self.model, self.data
        q, v, X = self.to_pinocchio(state)
        pin.centerOfMass(model, data, q, v, self.drift(v))
        out = {
            "com": data.com[0].copy(),
            "com_velocity": data.vcom[0].copy(),
            "com_bias_acceleration": data.acom[0].copy(),
            "com_jacobian": pin.jacobianCenterOfMass(model, data, q) @ X,
        }
        pin.computeCentroidalMomentum(model, data, q, v)
        out["centroidal_momentum"] = data.hg.vector.copy()
        out["centroidal_momentum_matrix"] = pin.ccrba(model, data, q, v) @ X
        return out

    def random_state(self, rng):
        n = len(self.joints)
        state = {}
        if self.floating:
            state = {
                "p_WB": rng.uniform(-3, 3, 3),
                "R_WB": random_rotation(rng),
                "v_WB": rng.uniform(-2, 2, 3),
                "w_WB_W": rng.uniform(-3, 3, 3),
            }
        return state | {
            "q": rng.uniform(-2, 2, n),
            "qd": rng.uniform(-5, 5, n),
            "vd": rng.uniform(-10, 10, self.nb + n),
        }


def plain(value):
    """Lists and floats; matrices by rows."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    # Adding zero turns -0.0 into 0.0.
    return (np.asarray(value) + 0.0).tolist()


def main():
    for name, path, floating, count, links in ROBOTS:
        rng = np.random.default_rng(20261122)
        robot = Robot(path, floating)
        robot.links = links or robot.links
        states = []
        for i in range(count):
            state = robot.random_state(rng)
            if i == count - 1 and floating:
                state |= {"p_WB": FAR, "v_WB": FAST}
            states.append({"state": plain(state), "expected": plain(robot.expected(state))})
        content = {
            "made_by": f"scripts/pinocchio_fixtures.py with Pinocchio {pin.__version__}",
            "joints": robot.joints,
            "total_mass": pin.computeTotalMass(Robot(path, True).model),
            "states": states,
        }
        with open(DATA / f"{name}.json", "w") as file:
            json.dump(content, file, separators=(",", ":"))
            file.write("\n")


if __name__ == "__main__":
    main()
