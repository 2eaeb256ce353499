#!/usr/bin/env python3
"""Hierarchies of least-squares problems with solutions from an independent cascade, in the format of `hoof solve`.

    pip install numpy scipy quadprog
    python3 scripts/hierarchy_fixtures.py

writes tests/data/hierarchies.json. Each level is solved by quadprog (Goldfarb and Idnani) in an orthonormal basis of the null space of the levels above, from
the singular values of their rows. Among the problems are dependent and conflicting rows, equalities, and constraints from a lower level on.
"""

import json
import pathlib

import numpy as np
import quadprog
from scipy.linalg import null_space

OUT = pathlib.Path(__file__).resolve().parent.parent / "tests/data/hierarchies.json"
REGULARIZATION = 1e-6


def rows_with_gap(rng, m, n, rank):
    """Rows whose singular values are 0 or between 0.2 and 1."""
    u = np.linalg.qr(rng.normal(size=(m, m)))[0][:, :rank]
    v = np.linalg.qr(rng.normal(size=(n, n)))[0][:, :rank]
    return u @ np.diag(rng.uniform(0.2, 1, rank)) @ v.T


def draw(rng, kind):
    n = int(rng.integers(6, 13))
    sizes = [int(rng.integers(1, 5)) for _ in range(int(rng.integers(1, 5)))]
    levels = []
    for k, m in enumerate(sizes):
        rank = min(m, n) if kind != "dependent" else max(1, min(m, n) - 1)
        a = rows_with_gap(rng, m, n, rank)
        if kind == "dependent" and k > 0:
            a[0] = np.array(levels[k - 1]["A"])[0]
        level = {"A": a, "b": rng.uniform(-2, 2, m), "weight": rng.uniform(0.5, 2, m)}
        if kind == "constrained" and k == 1:
            level |= {"C": rows_with_gap(rng, 1, n, 1), "c_lower": [-0.3], "c_upper": [None]}
        levels.append(level)
    bound = {"free": None, "dependent": 0.7, "bounded": 0.4, "constrained": 0.8}[kind]
    problem = {
        "n": n,
        "regularization": REGULARIZATION,
        "lower": [None if bound is None else -bound] * n,
        "upper": [bound] * n,
        "C": [], "c_lower": [], "c_upper": [],
        "levels": levels,
    }
    if kind == "constrained":
        c = rows_with_gap(rng, 3, n, 3)
        side = 0.1 * rng.normal()
        problem |= {"C": c, "c_lower": [side, -0.2, None], "c_upper": [side, 0.2, 0.3]}
    return problem


def solve(problem):
    """The solution, level by level."""
    n, lam = problem["n"], problem["regularization"]
    x, basis = np.zeros(n), np.eye(n)
    rows = []  # (row, lower, upper)
    for i in range(n):
        rows.append((np.eye(n)[i], problem["lower"][i], problem["upper"][i]))
    rows += list(zip(problem["C"], problem["c_lower"], problem["c_upper"]))
    equal = [(c, lo) for c, lo, up in rows if lo is not None and lo == up]
    if equal:
        a, b = np.array([c for c, _ in equal]), np.array([side for _, side in equal])
        x, basis = np.linalg.lstsq(a, b, rcond=None)[0], null_space(a, rcond=1e-7)
    rows = [row for row in rows if row[1] is None or row[1] != row[2]]
    for level in problem["levels"]:
        rows += list(zip(level.get("C", []), level.get("c_lower", []), level.get("c_upper", [])))
        root = np.sqrt(level["weight"])[:, None]
        a, b = root * level["A"], root[:, 0] * level["b"]
        j = a @ basis
        hessian = j.T @ j + lam * np.eye(basis.shape[1])
        gradient = j.T @ (b - a @ x) - lam * basis.T @ x
        g, h = [], []
        for c, lower, upper in rows:
            if lower is not None:
                g.append(c @ basis), h.append(lower - c @ x)
            if upper is not None:
                g.append(-c @ basis), h.append(c @ x - upper)
        if basis.shape[1] == 0:
            z = np.zeros(0)
        elif g:
            z = quadprog.solve_qp(hessian, gradient, np.array(g).T, np.array(h))[0]
        else:
            z = np.linalg.solve(hessian, gradient)
        x = x + basis @ z
        if basis.shape[1]:
            basis = basis @ null_space(j, rcond=1e-6) if np.linalg.norm(j) > 1e-9 else basis
    return x


def residuals(problem, x):
    return [float(np.sqrt(np.sum(lv["weight"] * (lv["A"] @ x - lv["b"]) ** 2))) for lv in problem["levels"]]


def plain(value):
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list) else value


def main():
    rng, cases = np.random.default_rng(7), []
    for kind in ["free", "dependent", "bounded", "constrained"]:
        count = 0
        while count < 6:
            problem = draw(rng, kind)
            try:
                x = solve(problem)
            except ValueError:  # no feasible point
                continue
            cases.append({"kind": kind, "problem": plain(problem), "x": x.tolist(), "residuals": residuals(problem, x)})
            count += 1
    OUT.write_text(json.dumps(cases, separators=(",", ":")).replace('},{"kind"', '},\n{"kind"') + "\n")
    print(f"{len(cases)} problems in {OUT.name}")


main()
