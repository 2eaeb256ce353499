#!/usr/bin/env python3
"""Writes the URDF of a robot of this repository from a table of its figures.

    python3 scripts/robot_urdf.py centauro FIGURES.toml > robots/centauro/centauro.urdf
    python3 scripts/robot_urdf.py coman_plus FIGURES.toml > controller/model/tests/data/coman_plus.urdf

FIGURES.toml has `[[link]]` with name, mass, com (m) and inertia (ixx iyy izz ixy ixz iyz, kg m^2, about com in link axes), and `[[joint]]` with name,
type, parent, child, xyz, rpy, axis, lower, upper, effort, velocity and dynamics {damping, friction}, as in a URDF. The SOURCES file of the robot says
where the figures are from. A floating joint and its parent link are left out: the child is the root. The shapes below are our own.
"""

import math
import sys
import tomllib

# Joints of the source that are fixed here.
FIXED = {"centauro": ["neck_yaw", "neck_pitch", "neck_velodyne"], "coman_plus": []}


def cylinder(start, end, radius):
    """A cylinder from a point to a point of the link."""
    d = [b - a for a, b in zip(start, end)]
    length = math.sqrt(sum(x * x for x in d))
    yaw, pitch = math.atan2(d[1], d[0]), math.acos(d[2] / length)
    middle = [(a + b) / 2 for a, b in zip(start, end)]
    return middle, [0.0, pitch, yaw], f'<cylinder radius="{radius}" length="{length:.4f}"/>'


def box(middle, size):
    return middle, [0.0] * 3, f'<box size="{" ".join(map(str, size))}"/>'


def sphere(radius):
    return [0.0] * 3, [0.0] * 3, f'<sphere radius="{radius}"/>'


def shapes(robot):
    """Link -> shape. They are inside the robot's outline, and end before the joints, so that neighbours do not touch."""
    if robot != "centauro":
        return {}
    found = {"pelvis": box([0, 0, 0.06], [0.56, 0.22, 0.16]), "torso_2": box([0, 0, 0.14], [0.16, 0.24, 0.3])}
    for leg in "1234":
        found |= {
            f"hip2_{leg}": cylinder([0, 0.08, -0.0036], [0, 0.24, -0.0036], 0.04),
            f"knee_{leg}": cylinder([0.05, 0, -0.1], [0.15, 0, -0.1], 0.04),
            f"ankle2_{leg}": cylinder([0, 0, 0.05], [0, 0, 0.15], 0.03),
            f"wheel_{leg}": ([0, 0, 0], [0, 0, 0], '<cylinder radius="0.078" length="0.03"/>'),
        }
    for arm in "12":
        found |= {
            f"arm{arm}_2": cylinder([0.06, 0, -0.05], [0.08, 0, -0.15], 0.04),
            f"arm{arm}_4": cylinder([0, 0, -0.04], [0, 0, -0.08], 0.04),
            f"arm{arm}_6": cylinder([0, 0, -0.05], [0, 0, -0.12], 0.03),
            f"arm{arm}_8": sphere(0.05),
        }
    return found


def numbers(values):
    return " ".join(repr(float(x) + 0.0) for x in values)


def main():
    robot, path = sys.argv[1], sys.argv[2]
    with open(path, "rb") as file:
        figures = tomllib.load(file)
    worlds = {joint["parent"] for joint in figures["joint"] if joint["type"] == "floating"}
    shape_of = shapes(robot)
    print(f'<?xml version="1.0"?>\n<!-- Written by scripts/robot_urdf.py. -->\n<robot name="{robot}">')
    for link in figures["link"]:
        if link["name"] in worlds:
            continue
        inside = []
        if link.get("mass"):
            keys = zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"], link["inertia"])
            inside += [
                "<inertial>",
                f'  <origin xyz="{numbers(link["com"])}"/>',
                f'  <mass value="{link["mass"]}"/>',
                "  <inertia " + " ".join(f'{key}="{value}"' for key, value in keys) + "/>",
                "</inertial>",
            ]
        if link["name"] in shape_of:
            xyz, rpy, geometry = shape_of[link["name"]]
            for what in ["visual", "collision"]:
                origin = f'<origin xyz="{numbers(xyz)}" rpy="{numbers(rpy)}"/>'
                inside += [f"<{what}>", f"  {origin}", f"  <geometry>{geometry}</geometry>", f"</{what}>"]
        if not inside:
            print(f'  <link name="{link["name"]}"/>')
            continue
        print(f'  <link name="{link["name"]}">', *(f"    {line}" for line in inside), "  </link>", sep="\n")
    for joint in figures["joint"]:
        if joint["type"] == "floating":
            continue
        kind = "fixed" if joint["name"] in FIXED[robot] else joint["type"]
        print(f'  <joint name="{joint["name"]}" type="{kind}">')
        print(f'    <origin xyz="{numbers(joint["xyz"])}" rpy="{numbers(joint["rpy"])}"/>')
        print(f'    <parent link="{joint["parent"]}"/>\n    <child link="{joint["child"]}"/>')
        if kind != "fixed":
            limits = {key: joint[key] for key in ["lower", "upper", "effort", "velocity"] if key in joint}
            print(f'    <axis xyz="{numbers(joint["axis"])}"/>')
            print("    <limit " + " ".join(f'{key}="{value}"' for key, value in limits.items()) + "/>")
            if "dynamics" in joint:
                print("    <dynamics " + " ".join(f'{key}="{value}"' for key, value in joint["dynamics"].items()) + "/>")
        print("  </joint>")
    print("</robot>")


if __name__ == "__main__":
    main()
