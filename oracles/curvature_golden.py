"""Writes crates/froufrou/tests/fixtures/cloth/curvature.json: mean curvature and areas by libigl.

Dev-only. Needs libigl, numpy and scipy from PyPI:

    pip install libigl numpy scipy
    python oracles/curvature_golden.py

Three small meshes: a crumpled sheet, a sheared one of obtuse triangles, and a dented ball. Of each vertex the mean
curvature (half of the cotangent Laplacian by the mixed Voronoi area, along the mean normal by area), and that area.
Vertices at the boundary have none.
"""

import json
import pathlib

import igl
import numpy as np
import scipy.spatial

OUT = pathlib.Path(__file__).resolve().parent.parent / "crates/froufrou/tests/fixtures/cloth/curvature.json"
random = np.random.default_rng(11)


def sheet(count, place):
    u, v = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count))
    points = np.stack(place(u.ravel(), v.ravel()), axis=1)
    corners = np.arange(count * count).reshape(count, count)
    a, b, c, d = (x.ravel() for x in (corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]))
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def ball():
    points = random.normal(size=(60, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    corners = scipy.spatial.ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[corners[:, i]] for i in range(3))
    inside = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    corners[inside] = corners[inside][:, ::-1]
    return points * (1 + 0.1 * random.uniform(-1, 1, size=(60, 1))), corners


def golden(points, corners):
    points = points.astype(np.float32).astype(float)
    mass = igl.massmatrix(points, corners, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    normals = igl.per_vertex_normals(points, corners, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_AREA)
    bend = -(igl.cotmatrix(points, corners) @ points) / mass[:, None]
    curvature = np.einsum("ij,ij->i", bend, normals) / 2
    edges, count = np.unique(
        np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    curvature[np.unique(edges[count == 1])] = 0
    return {
        "positions": points.tolist(),
        "corners": corners.tolist(),
        "mean_per_m": curvature.tolist(),
        "area_m2": mass.tolist(),
    }


crumpled = sheet(9, lambda u, v: (u + 0.02 * random.normal(size=u.size), v, 0.1 * np.sin(9 * u) * np.cos(7 * v)))
sheared = sheet(7, lambda u, v: (u + 2.5 * v, v, 0.2 * np.sin(3 * u + v)))
meshes = [golden(*mesh) for mesh in (crumpled, sheared, ball())]
OUT.write_text("[\n" + ",\n".join(json.dumps(mesh) for mesh in meshes) + "\n]\n")
