"""Writes thin-plate splines solved by NumPy, which the tests of warps read.

Dev-only. Needs numpy from PyPI:

    pip install numpy
    python oracles/warp_golden.py

units_warp.json: cases with points, where they go, λ, and where other points are carried by the solution of the whole
system [[K + λ α, P], [Pᵀ, 0]] (Belongie et al. 2002, eq. 10, with U(r) = r² log r²), α the mean squared distance of two
different points. Coincident points stand in the system one by one.
"""

import json
import pathlib

import numpy as np

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/units_warp.json"


def u(a, b):
    squared = ((a[:, None, :] - b[None, :, :]) ** 2).sum(-1)
    return np.where(squared > 0, squared * np.log(np.where(squared > 0, squared, 1)), 0)


def warp(points, to, lam, at):
    n, d = points.shape
    squared = ((points[:, None, :] - points[None, :, :]) ** 2).sum(-1)
    alpha = squared.sum() / (n * (n - 1))
    p = np.hstack([np.ones((n, 1)), points])
    system = np.block([[u(points, points) + lam * alpha * np.eye(n), p], [p.T, np.zeros((d + 1, d + 1))]])
    solution = np.linalg.solve(system, np.vstack([to - points, np.zeros((d + 1, d))]))
    return at + np.hstack([np.ones((len(at), 1)), at]) @ solution[n:] + u(at, points) @ solution[:n]


random = np.random.default_rng(11)
cases = []
for name, n, d, lam, scale in [
    ("interpolating", 12, 3, 0, 1),
    ("stiff", 25, 3, 100, 5),
    ("very stiff", 20, 3, 1e5, 5),
    ("two ears", 24, 6, 1, 4),
    ("one dimension", 9, 1, 0.1, 2),
    ("affine", 4, 3, 0, 1),
    ("coincident", 16, 3, 10, 3),
]:
    points = np.round(random.normal(size=(n, d)) * scale, 6)
    if name == "coincident":
        points[5] = points[11] = points[2]
        points[7] = points[8]
    to = np.round(points * 0.7 + 2 + random.normal(size=(n, d)), 6)
    at = np.round(random.normal(size=(6, d)) * scale * 1.5, 6)
    warped = warp(points, to, lam, at)
    flat = lambda a: [float(v) for v in a.ravel()]
    case = dict(name=name, dimensions=d, to=flat(to), at=flat(at), warped=flat(warped))
    cases.append({"lambda": lam, "from": flat(points), **case})
OUT.write_text(json.dumps(cases, indent=None, separators=(",", ":")) + "\n")
print(OUT.stat().st_size, "bytes")
