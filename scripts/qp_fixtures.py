#!/usr/bin/env python3
"""Exact solutions of whole-body control programs, against which the controller's solver is tested.

    pip install quadprog mpmath numpy
    python3 scripts/qp_fixtures.py

runs the test `qp_solutions` to dump its programs, solves them and writes controller/tests/data/qp_solutions.json. The active set is from
quadprog (Goldfarb and Idnani's dual method). With a known active set the optimality conditions are linear; they are solved in 60 digits. The
result is accepted only if it is feasible and its multipliers have the right sign: then it is the minimizer, independent of the solver.
"""

import json
import os
import pathlib
import subprocess
import tempfile

import mpmath
import numpy as np
import quadprog

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "controller/tests/data/qp_solutions.json"
mpmath.mp.dps = 60


def dumped_programs():
    """The programs that the test dumps."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "programs.json"
        command = ["cargo", "test", "--release", "-p", "controller", "--test", "qp_solutions", "exact"]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"QP_DUMP": str(path)}, check=True)
        return json.loads(path.read_text())


def rows_of(p):
    """Equality rows A x = b and inequality rows G x >= h, bounds among them."""
    n = len(p["g"])
    A, C = (np.array(p[m]).reshape(n, -1).T for m in ("A", "C"))
    G, h = [-C], [-np.array(p["d"])]
    for sign, name in ((1.0, "lower"), (-1.0, "upper")):
        finite = [i for i, bound in enumerate(p[name]) if bound is not None]
        G.append(sign * np.eye(n)[finite])
        h.append(np.array([sign * p[name][i] for i in finite]))
    return A, np.array(p["b"]), np.vstack(G), np.concatenate(h)


def first_active_set(H, g, A, b, G, h):
    """From quadprog, in variables scaled so that its Cholesky factorization of H is well-conditioned."""
    s = 1.0 / np.sqrt(np.diag(H))
    rows = np.vstack([A, G]) * s
    norms = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    right = np.concatenate([b, h]) / norms
    solution = quadprog.solve_qp(H * np.outer(s, s), -g * s, (rows / norms[:, None]).T, right, len(b))
    return sorted(int(i) - 1 - len(b) for i in solution[5] if i > len(b))


def optimum(H, g, A, b, G, h, active):
    """The point at which the rows in `active` hold with equality and the gradient vanishes; x and the multipliers of `active`."""
    n, m = len(g), len(b) + len(active)
    E, e = np.vstack([A, G[active]]), np.concatenate([b, h[active]])
    K, r = mpmath.zeros(n + m), mpmath.zeros(n + m, 1)
    for i in range(n):
        r[i] = -mpmath.mpf(g[i])
        for j in range(n):
            K[i, j] = mpmath.mpf(H[i, j])
    for i in range(m):
        r[n + i] = mpmath.mpf(e[i])
        for j in range(n):
            K[n + i, j] = mpmath.mpf(E[i, j])
            K[j, n + i] = -K[n + i, j]
    z = mpmath.lu_solve(K, r)
    return z[:n], z[n + len(b) :]


def exact(p):
    """The minimizer and its active set, by exchanging rows until the optimality conditions hold in 60 digits."""
    H, g = np.array(p["H"]).reshape(len(p["g"]), -1), np.array(p["g"])
    A, b, G, h = rows_of(p)
    active = first_active_set(H, g, A, b, G, h)
    for _ in range(50):
        x, multipliers = optimum(H, g, A, b, G, h, active)
        slack = [mpmath.fdot(zip(map(mpmath.mpf, row), x)) - mpmath.mpf(right) for row, right in zip(G, h)]
        worst = min((s for i, s in enumerate(slack) if i not in active), default=mpmath.mpf(0))
        if len(active) and min(multipliers) < 0:
            active.pop(list(multipliers).index(min(multipliers)))
        elif worst < 0:
            active = sorted(active + [slack.index(worst)])
        else:
            return [float(v) for v in x], active
    raise RuntimeError("no active set fits")


def main():
    solutions = []
    for k, p in enumerate(dumped_programs()):
        x, active = exact(p)
        off = np.linalg.norm(np.array(p["clarabel"]) - x) / np.linalg.norm(x)
        print(f"program {k}: {len(active)} active inequalities, Clarabel off by {off:.1e}")
        solutions.append({"digest": p["digest"], "active": len(active), "x": x})
    OUT.write_text("[\n" + ",\n".join(json.dumps(s) for s in solutions) + "\n]\n")


if __name__ == "__main__":
    main()
