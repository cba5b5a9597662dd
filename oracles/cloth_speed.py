"""Holds curvature and contacts of cloth against libigl: the same answers, and how long each takes.

Dev-only. Needs alembic3d, libigl, numpy and scipy from PyPI, and a built example:

    pip install alembic3d==1.8.12.1 libigl numpy scipy
    cargo build --release -p froufrou --no-default-features --example cloth_speed
    FROUFROU_DATA=../shared/data python oracles/cloth_speed.py [PROGRAM]

Takes the dancer in a dress of the project's data: 14 783 vertices against 12 811, 121 frames.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import igl
import numpy as np
import scipy.sparse

import alembic_oracle

DATA = pathlib.Path(os.environ.get("FROUFROU_DATA", "../shared/data")) / "anim"
ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else ROOT / "target/release/examples/cloth_speed"
RADIUS, ASKED = 0.05, 12


def triangles(sizes, corners):
    """As froufrou cuts them, where all faces are triangles; else the script is of no use."""
    assert np.all(sizes == 3), "the dress and the dancer are triangles"
    return corners.reshape(-1, 3)


def igl_curvature(v, f):
    laplacian = igl.cotmatrix(v, f)
    mass = igl.massmatrix(v, f, igl.MASSMATRIX_TYPE_VORONOI)
    inverse = scipy.sparse.diags(1 / mass.diagonal())
    return -inverse @ (laplacian @ v), mass.diagonal()


def timed(work, count):
    """What it gives, and the processor time and clock it takes, in seconds."""
    clocks, started_processor = [], time.process_time()
    for _ in range(count):
        started = time.perf_counter()
        found = work()
        clocks.append(time.perf_counter() - started)
    return found, (time.process_time() - started_processor) / count, min(clocks)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    meshes = [o for o in alembic_oracle.objects(str(DATA / "rumba_dress.abc")) if o.kind == "Mesh"]
    meshes.sort(key=lambda o: "Garment" not in o.path)
    times = meshes[0].key_times()
    kept = {}
    for entry, called in zip(meshes, ("cloth", "other")):
        corners, sizes = entry.faces(times[0])
        # Alembic winds clockwise.
        corners = np.concatenate([part[::-1] for part in np.split(np.array(corners), np.cumsum(sizes)[:-1])])
        frames = np.stack([entry.positions(t) for t in times]).astype("<f4")
        np.asarray(sizes).astype("<u4").tofile(folder / f"{called}.sizes")
        np.asarray(corners).astype("<u4").tofile(folder / f"{called}.corners")
        np.array([frames.shape[1]], "<u4").tofile(folder / f"{called}.count")
        frames.tofile(folder / f"{called}.positions")
        kept[called] = (frames[-1].astype(float), triangles(np.asarray(sizes), np.asarray(corners)).astype(np.int64))
        print(f"{called}: {entry.path}, {frames.shape[1]} vertices, {len(kept[called][1])} triangles, {len(frames)} frames")

    command = [PROGRAM, str(folder), str(RADIUS)]
    said = {}
    for threads in ("1", ""):
        environment = dict(os.environ, **({"RAYON_NUM_THREADS": threads} if threads else {}))
        out = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
        said[threads] = {line.split()[0]: [float(x) for x in line.split()[1:]] for line in out.splitlines()}
    count = len(times)
    one, all_ = said["1"], said[""]

    (v, f), (w, g) = kept["cloth"], kept["other"]
    (normals, masses), curvature_s, _ = timed(lambda: igl_curvature(v, f), ASKED)
    (squared, nearest, _), query_s, query_clock_s = timed(lambda: igl.point_mesh_squared_distance(v, w, g), ASKED)

    ours = np.fromfile(folder / "curvature.f64").reshape(-1, 2)
    inner = ours[:, 0] != 0
    theirs = np.einsum("ij,ij->i", normals, igl.per_vertex_normals(v, f, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_AREA)) / 2
    error = np.abs(ours[:, 0] - theirs)[inner] / np.maximum(1, np.abs(theirs[inner]))
    print(f"curvature: {inner.sum()} vertices, worst difference {error.max():.1e}, of areas {np.abs(ours[:, 1] - masses).max():.1e} m²")
    contacts = np.fromfile(folder / "contacts.f64").reshape(-1, 2)
    asked = contacts[:, 0] >= 0
    away = np.abs(contacts[asked, 1] - np.sqrt(squared[asked])).max()
    print(f"contacts: {asked.sum()} vertices, {(np.sqrt(squared) <= RADIUS).sum()} within {RADIUS} m; worst difference of distances {away:.1e} m")

    vertices = len(v)

    def of_frame(said, what, which=0):
        """Milliseconds of processors (0) or by the clock (1)."""
        return 1e3 * said[what][which] / count

    ours_ms = of_frame(one, "curvature")
    print("milliseconds a frame, of one processor:")
    print(f"  curvature: libigl {1e3 * curvature_s:.2f}, froufrou {ours_ms:.3f}: {1e3 * curvature_s / ours_ms:.0f} times as fast")
    print(f"  curvature and buckles: froufrou {of_frame(one, 'both'):.3f}")
    print(f"  taking up both meshes: froufrou {of_frame(one, 'follow'):.3f}")
    print(f"  closest triangles, with taking up the other mesh: libigl {1e3 * query_s:.2f} ({1e9 * query_s / vertices:.0f} ns a query)")
    for radius in ("any", "near"):
        ours_ms = of_frame(one, radius)
        print(f"    froufrou, {radius:4}: {ours_ms:.2f} ({1e6 * ours_ms / vertices:.0f} ns a query): {1e3 * query_s / ours_ms:.1f} times as fast")
    print("by the clock, on all processors:")
    for radius in ("any", "near"):
        print(f"  closest triangles, {radius:4}: libigl {1e3 * query_clock_s:.2f}, froufrou {of_frame(all_, radius, 1):.2f}")
    for said, threads in ((one, "one thread"), (all_, "all")):
        (all_s, clock_s), (begin_s, _) = said["all"], said["begin"]
        print(f"all of {count} frames on {threads}: {all_s:.2f} s of processors, {clock_s:.2f} s by the clock; the first frame {begin_s:.2f} s of it")
    assert away < 1e-6 and error.max() < 1e-3
