#!/usr/bin/env python3
"""Times alembic3d and froufrou reading every mesh of every frame of the largest test animation.

    pip install alembic3d==1.8.12.1 numpy
    python oracles/alembic_speed.py

Both open rumba_dress.abc, read the positions and the faces of every mesh at every frame and bring
the positions to world space; alembic3d with numpy, its arrays taken without a copy.
"""

import os
import subprocess
import time

import numpy as np
from alembic3d import Abc

import alembic_oracle
from alembic_compare import ROOT, data_folder

ARCHIVE = data_folder() / "anim/rumba_dress.abc"


def read_all():
    total = 0.0
    for entry in alembic_oracle.objects(ARCHIVE):
        if entry.kind != "Mesh":
            continue
        schema = entry.schema
        for moment in entry.key_times() or [0.0]:
            sample = schema.getValue(Abc.ISampleSelector(moment))
            local = np.asarray(memoryview(sample.getPositions()))
            faces = sample.getFaceIndices(), sample.getFaceCounts()
            assert len(faces[0]) and len(faces[1])
            world = entry.world(moment)
            positions = local @ world[:3, :3].T.astype(np.float32) + world[:3, 3].astype(np.float32)
            total += float(positions[0, 0])
    return total


if __name__ == "__main__":
    read_all()
    runs = []
    for _ in range(10):
        begin = time.perf_counter()
        read_all()
        runs.append(time.perf_counter() - begin)
    print(f"alembic3d: fastest {min(runs) * 1e3:.1f} ms, median {sorted(runs)[5] * 1e3:.1f} ms", flush=True)
    environment = dict(os.environ, FROUFROU_DATA=str(data_folder().resolve()))
    bench = ["cargo", "bench", "--quiet", "--package", "froufrou", "--bench", "alembic"]
    subprocess.run(bench, check=True, cwd=ROOT, env=environment)
