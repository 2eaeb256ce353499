#!/usr/bin/env python3
"""Writes the URDF of a robot of this repository from a table of its figures.

    python3 scripts/robot_urdf.py centauro FIGURES.toml > robots/centauro/centauro.urdf
    python3 scripts/robot_urdf.py coman_plus FIGURES.toml > robots/coman_plus/coman_plus.urdf

Robots: centauro; centauro_upper, its torso and arms on a stand, from the same table; coman_plus; coman.

FIGURES.toml has `[[link]]` with name, mass, com (m) and inertia (ixx iyy izz ixy ixz iyz, kg m^2, about com in link axes), and `[[joint]]` with name,
type, parent, child, xyz, rpy, axis, lower, upper, effort, velocity and dynamics {damping, friction}, as in a URDF; com_rpy of a link rotates the axes of its inertia. The SOURCES file of the robot says
where the figures are from. A floating joint and its parent link are left out: the child is the root. The shapes below are our own.
"""

import math
import sys
import tomllib

# Joints of the source that are fixed here.
NECK = ["neck_yaw", "neck_pitch", "neck_velodyne"]
FIXED = {"centauro": NECK, "centauro_upper": NECK, "coman_plus": [], "coman": []}
# Height of the pelvis of centauro_upper on its stand, m.
STAND = 0.811


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


def limbs(figures):
    """Link -> a cylinder on the way from its own joint to its farthest movable child."""
    found = {}
    for link in figures["link"]:
        children = [j for j in figures["joint"] if j["parent"] == link["name"] and j["type"] not in ("fixed", "floating")]
        ends = sorted((j["xyz"] for j in children), key=lambda xyz: math.hypot(*xyz))
        if link.get("mass") and ends and math.hypot(*ends[-1]) > 0.1:
            end, radius = ends[-1], min(0.04, 0.18 * math.hypot(*ends[-1]))
            found[link["name"]] = cylinder([0.3 * x for x in end], [0.75 * x for x in end], round(radius, 3))
    return found


def humanoid(robot, figures):
    """Shapes of COMAN+ and COMAN."""
    found = limbs(figures)
    if robot == "coman_plus":
        found |= {"Waist": box([-0.02, 0, 0], [0.12, 0.14, 0.08]), "DWYTorso": box([0, 0, 0.13], [0.16, 0.2, 0.2])}
    else:
        found |= {"Waist": box([-0.03, 0, 0.06], [0.08, 0.08, 0.08]), "DWYTorso": box([-0.03, 0, 0.12], [0.1, 0.1, 0.12])}
    return found


def shapes(robot, figures):
    """Link -> shape. They are inside the robot's outline, and end before the joints, so that neighbours do not touch."""
    if not robot.startswith("centauro"):
        return humanoid(robot, figures)
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


def upper_body(figures):
    """Leaves out the legs, and puts the pelvis on a stand."""
    parent = {joint["child"]: joint["parent"] for joint in figures["joint"]}

    def is_leg(link):
        return link.startswith("hip1_") or (link in parent and is_leg(parent[link]))

    figures["link"] = [{"name": "stand"}] + [link for link in figures["link"] if not is_leg(link["name"])]
    figures["joint"] = [joint for joint in figures["joint"] if not is_leg(joint["child"])]
    joint = {"name": "stand_joint", "type": "fixed", "parent": "stand", "child": "pelvis"}
    figures["joint"].append(joint | {"xyz": [0.0, 0.0, STAND], "rpy": [0.0] * 3})


def numbers(values):
    return " ".join(repr(float(x) + 0.0) for x in values)


def rpy_of(link):
    return f' rpy="{numbers(link["com_rpy"])}"' if "com_rpy" in link else ""


def main():
    robot, path = sys.argv[1], sys.argv[2]
    with open(path, "rb") as file:
        figures = tomllib.load(file)
    if robot == "centauro_upper":
        upper_body(figures)
    worlds = {joint["parent"] for joint in figures["joint"] if joint["type"] == "floating"}
    shape_of = shapes(robot, figures)
    print(f'<?xml version="1.0"?>\n<!-- Written by scripts/robot_urdf.py. -->\n<robot name="{robot}">')
    for link in figures["link"]:
        if link["name"] in worlds:
            continue
        inside = []
        if link.get("mass"):
            keys = zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"], link["inertia"])
            inside += [
                "<inertial>",
                f'  <origin xyz="{numbers(link["com"])}"' + rpy_of(link) + "/>",
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
