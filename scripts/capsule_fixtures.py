#!/usr/bin/env python3
"""Writes distances of random capsules, computed by Coal (the collision library of Pinocchio): controller/model/tests/data/capsules.json.

    pip install pin==4.1.0
    python3 scripts/capsule_fixtures.py

Each pair: the two segments, [x, y, z] of both ends, m; the radii, m; the distance, m, negative if the capsules overlap. Every fourth pair is parallel, every fifth
has a segment that is a point.
"""

import json
import pathlib

import coal
import numpy as np

FILE = pathlib.Path(__file__).resolve().parent.parent / "controller/model/tests/data/capsules.json"


def placed(ends, radius):
    """Coal's capsule and its pose: along z, the origin in the middle."""
    a, b = ends
    length = np.linalg.norm(b - a)
    z = (b - a) / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    shape = coal.Capsule(radius, length) if length > 0 else coal.Sphere(radius)
    return shape, coal.Transform3s(R, (a + b) / 2)


def main():
    rng = np.random.default_rng(20261201)
    pairs = []
    for i in range(100):
        a, b = rng.uniform(-1, 1, (2, 3)), rng.uniform(-1, 1, (2, 3))
        if i % 4 == 1:
            b[1] = b[0] + rng.uniform(-2, 2) * (a[1] - a[0])
        if i % 5 == 2:
            b[1] = b[0]
        radii = rng.uniform(0.01, 0.2, 2)
        shapes = placed(a, radii[0]), placed(b, radii[1])
        result = coal.DistanceResult()
        distance = coal.distance(shapes[0][0], shapes[0][1], shapes[1][0], shapes[1][1], coal.DistanceRequest(), result)
        pairs.append({"a": a.tolist(), "b": b.tolist(), "radii": radii.tolist(), "distance": distance})
    content = {"made_by": f"scripts/capsule_fixtures.py with Coal {coal.__version__}", "pairs": pairs}
    with open(FILE, "w") as file:
        json.dump(content, file, separators=(",", ":"))
        file.write("\n")


if __name__ == "__main__":
    main()
