#!/usr/bin/env python3
"""Writes the expected values of the test `public_srdfs` of robot-model, computed by Pinocchio and from the elements of the files.

    pip install pin==4.1.0
    scripts/fetch_robots.sh && python3 scripts/srdf_fixtures.py

makes controller/model/tests/data/public_srdfs.json from every SRDF below target/robots that has a URDF beside it. For each pair of files:

- `groups`: name and movable joints, in the order of the URDF's text, of each group with at least one; by the rules of MoveIt;
- `states`: name and, for each movable joint that the state names, its position in the reference configuration of Pinocchio, rad or m;
- `pairs`: pairs of links of which Pinocchio removes the collision, as indices into the sorted names of the links;
- `passive`: the movable passive joints, in the order of the URDF's text.

The URDF of an SRDF is the one of its robot's folder in which the most of its names exist, the first one by name if several are equal.
"""

import json
import math
import pathlib
import xml.etree.ElementTree as ET

import coal
import pinocchio as pin

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROBOTS = ROOT / "target/robots"
OUT = ROOT / "controller/model/tests/data/public_srdfs.json"


class Urdf:
    """The names of a URDF and how its links are connected."""

    def __init__(self, path):
        self.path = path
        root = ET.fromstring(path.read_bytes().lstrip())
        joints = root.findall("joint")
        self.links = sorted(link.get("name") for link in root.findall("link"))
        # A floating joint is the base, no joint of the model.
        self.movable = [j.get("name") for j in joints if j.get("type") not in ("fixed", "floating")]
        self.above = {j.find("child").get("link"): (j.get("name"), j.find("parent").get("link")) for j in joints}
        self.names = {j.get("name") for j in joints} | set(self.links)

    def to_root(self, link):
        """The joints from a link to the root."""
        joints = []
        while link in self.above:
            joint, link = self.above[link]
            joints.append(joint)
        return joints


def names_of(srdf):
    names = [child.get("name") for tag in ("group", "group_state") for e in srdf.findall(tag) for child in e if child.tag in ("joint", "link")]
    chains = [chain.get(end) for chain in srdf.findall("group/chain") for end in ("base_link", "tip_link")]
    return names + chains + [pair.get(link) for pair in srdf.findall("disable_collisions") for link in ("link1", "link2")]


def group_joints(srdf, urdf, name):
    """All joints of a group: the union of its elements."""
    joints = set()
    for group in (g for g in srdf.findall("group") if g.get("name") == name):
        joints.update(e.get("name") for e in group.findall("joint"))
        joints.update(urdf.above[e.get("name")][0] for e in group.findall("link") if e.get("name") in urdf.above)
        for chain in group.findall("chain"):
            base, tip = chain.get("base_link"), chain.get("tip_link")
            if base in urdf.links and tip in urdf.links:
                joints |= set(urdf.to_root(base)) ^ set(urdf.to_root(tip))
        for inner in group.findall("group"):
            joints |= group_joints(srdf, urdf, inner.get("name"))
    return joints


def removed_pairs(model, links, path):
    """The pairs that Pinocchio removes, of all pairs of links with one sphere each."""
    geometry = pin.GeometryModel()
    for link in links:
        frame = model.getBodyId(link)
        parent = model.frames[frame].parentJoint
        geometry.addGeometryObject(pin.GeometryObject(link, parent, frame, pin.SE3.Identity(), coal.Sphere(0.1)))
    for a in range(len(links)):
        for b in range(a):
            geometry.addCollisionPair(pin.CollisionPair(b, a))
    pin.removeCollisionPairs(model, geometry, str(path))
    kept = {(pair.first, pair.second) for pair in geometry.collisionPairs}
    return [[b, a] for b in range(len(links)) for a in range(b + 1, len(links)) if (b, a) not in kept]


def expected(path):
    """The expected values of one file, or `None` without a URDF."""
    srdf = ET.parse(path).getroot()
    urdfs = [Urdf(urdf) for urdf in sorted(path.parent.parent.rglob("*.urdf"))]
    if not urdfs:
        return None
    names = names_of(srdf)
    urdf = min(urdfs, key=lambda urdf: sum(name not in urdf.names for name in names))
    model = pin.buildModelFromUrdf(str(urdf.path))
    pin.loadReferenceConfigurations(model, str(path))
    groups = []
    for group in srdf.findall("group"):
        joints = group_joints(srdf, urdf, group.get("name"))
        groups.append([group.get("name"), [joint for joint in urdf.movable if joint in joints]])
    states = []
    for state in srdf.findall("group_state"):
        q, positions = model.referenceConfigurations[state.get("name")], {}
        for name in (joint.get("name") for joint in state.findall("joint")):
            if name in urdf.movable:
                joint = model.joints[model.getJointId(name)]
                at = q[joint.idx_q : joint.idx_q + joint.nq]
                positions[name] = at[0] if joint.nq == 1 else math.atan2(at[1], at[0])
        states.append([state.get("name"), positions])
    passive = {joint.get("name") for joint in srdf.findall("passive_joint")}
    return {
        "srdf": str(path.relative_to(ROBOTS)),
        "urdf": str(urdf.path.relative_to(ROBOTS)),
        "groups": [group for group in groups if group[1]],
        "states": states,
        "pairs": removed_pairs(model, urdf.links, path),
        "passive": [joint for joint in urdf.movable if joint in passive],
    }


def main():
    robots = [robot for robot in map(expected, sorted(ROBOTS.rglob("*.srdf"))) if robot]
    lines = ",\n".join(json.dumps(robot, separators=(",", ":")) for robot in robots)
    made_by = f"scripts/srdf_fixtures.py with Pinocchio {pin.__version__}"
    OUT.write_text(f'{{"made_by":"{made_by}","robots":[\n{lines}\n]}}\n')
    print(f"{OUT}: {len(robots)} files")


if __name__ == "__main__":
    main()
