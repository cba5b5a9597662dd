#!/usr/bin/env python3
"""Writes every transform and every vertex of every frame of an Alembic archive, by alembic3d.

    pip install alembic3d==1.8.12.1 numpy
    python oracles/alembic_dump.py dance.abc dance

makes dance.json, the index, and dance.bin: per object and key time the world matrix (16 float64,
row by row, column vectors), then the world-space vertices (3 float64 each).
"""

import json
import sys
from pathlib import Path

import numpy as np

import alembic_oracle


def dump(archive, output):
    index = []
    with open(Path(output).with_suffix(".bin"), "wb") as binary:
        for entry in alembic_oracle.objects(archive):
            times = entry.key_times()
            vertices = []
            for time in times or [0.0]:
                binary.write(entry.world(time).astype("<f8").tobytes())
                positions = entry.positions(time) if entry.kind == "Mesh" else np.zeros((0, 3))
                binary.write(positions.astype("<f8").tobytes())
                vertices.append(len(positions))
            index.append(
                {"path": entry.path, "kind": entry.kind, "key_times_s": times, "vertices": vertices}
            )
    Path(output).with_suffix(".json").write_text(json.dumps(index))


if __name__ == "__main__":
    dump(sys.argv[1], sys.argv[2])
