"""Estimates the impacts of tower.abc and writes them as contacts.csv.

Dev-only; the table is in the repository.

    pip install alembic3d numpy
    python examples/tower/make_contacts.py

The animation has transforms only, 24 a second. Between frames a free body's velocity changes by gravity
alone; whatever else it changes by, times the mass, is the impulse of a blow. A blow between two frames
shares its impulse between the two velocity changes about it, which tells its time below the frame. The
masses are those of the simulation: the ball 2 kg, a box 0.4 kg.
"""

import csv
import pathlib

import alembic3d
import numpy as np
from alembic3d import Abc, AbcGeom

HERE = pathlib.Path(__file__).parent
GRAVITY = np.array([0.0, -9.81, 0.0])
MASS = {"Ball": 2.0, **{f"Box{k}": 0.4 for k in range(10)}}
REACH = {"Ball": 0.12, **{f"Box{k}": 0.1 for k in range(10)}}
FLOOR_NS = {"Ball": 0.25, **{f"Box{k}": 0.08 for k in range(10)}}


def positions():
    archive = Abc.IArchive(str(HERE / "tower.abc"))
    top = archive.getTop()
    found, times = {}, None
    for k in range(top.getNumChildren()):
        header = top.getChildHeader(k)
        if header.getName() not in MASS:
            continue
        schema = AbcGeom.IXform(top, header.getName()).getSchema()
        count, sampling = schema.getNumSamples(), schema.getTimeSampling()
        places = []
        for i in range(count):
            # The selector takes a time in seconds.
            matrix = schema.getValue(Abc.ISampleSelector(sampling.getSampleTime(i))).getMatrix()
            places.append([matrix[3][c] for c in range(3)])
        found[header.getName()] = np.array(places)
        if count > 1:
            times = np.array([sampling.getSampleTime(i) for i in range(count)])
    return found, times - times[0]


def main():
    places, times = positions()
    step = times[1] - times[0]
    names = sorted(places)
    rows = []
    for name in names:
        p = places[name]
        # kick[i]: what changes the velocity at frame i beyond gravity, as an impulse.
        kick = MASS[name] * ((p[2:] - 2 * p[1:-1] + p[:-2]) / step - GRAVITY * step)
        # A resting body is held up against gravity, which is no blow.
        still = np.linalg.norm(p[2:] - p[:-2], axis=1) / (2 * step) < 0.05
        size = np.linalg.norm(kick, axis=1)
        hold = MASS[name] * 9.81 * step
        size = np.where(still, 0.0, np.maximum(size - hold, 0.0))
        i = 0
        while i < len(size):
            if size[i] < FLOOR_NS[name]:
                i += 1
                continue
            # The blow is felt at one or two frames; its time lies between them by their shares.
            share = size[i + 1] if i + 1 < len(size) and size[i + 1] > 0.2 * size[i] else 0.0
            impulse = size[i] + share
            at = times[i + 1] + step * share / impulse
            here = p[i + 1] + (p[min(i + 2, len(p) - 1)] - p[i + 1]) * share / impulse
            direction = kick[i] / max(np.linalg.norm(kick[i]), 1e-9)
            point = here - direction * REACH[name]
            others = [o for o in names if o != name]
            near = min(others, key=lambda o: np.linalg.norm(places[o][i + 1] - here))
            touching = np.linalg.norm(places[near][i + 1] - here) < REACH[name] + REACH[near] + 0.08
            other = near if touching else "Ground" if point[1] < 0.05 else "Ramp"
            rows.append((at, name, other, *point, impulse))
            i += 2 if share else 1
            # Ringing of the solver right after a blow is not another blow.
            while i < len(size) and size[i] < impulse * 0.5:
                if size[i] < FLOOR_NS[name]:
                    break
                i += 1
    rows.sort()
    with open(HERE / "contacts.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["t", "a", "b", "x", "y", "z", "impulse"])
        for t, a, b, x, y, z, impulse in rows:
            table.writerow([f"{t:.5f}", a, b, f"{x:.4f}", f"{y:.4f}", f"{z:.4f}", f"{impulse:.4f}"])
    print(f"{len(rows)} impacts")


if __name__ == "__main__":
    main()
