#!/usr/bin/env python3
"""Writes samples of what alembic3d reads from the test animations, which are too big to be kept.

    pip install alembic3d==1.8.12.1 numpy
    python oracles/alembic_golden.py

For each archive in $FROUFROU_DATA/anim (or ../shared/data/anim beside the repository) it writes
crates/froufrou/tests/fixtures/alembic/data/NAME.json: transforms and world-space vertices at random
moments, and for every object the sums of all vertices at a few moments. Of rumba_dress.abc, whose
meshes are not ours to copy, only the sums. The full comparison is alembic_compare.py.
"""

import json
import random
from pathlib import Path

from alembic_compare import data_folder
from alembic_fixtures import FOLDER
import alembic_oracle

VERTICES, TRANSFORMS, SUMS = 200, 40, 3


def golden(archive):
    choose = random.Random(archive.name)
    entries = alembic_oracle.objects(archive)
    moment = lambda entry: choose.choice(entry.key_times() or [0.0])
    transforms, vertices, sums = [], [], []
    for index, entry in enumerate(entries):
        if entry.kind != "Mesh":
            continue
        for _ in range(SUMS if entry.key_times() else 1):
            time = moment(entry)
            positions = entry.positions(time)
            sums.append([index, time, len(positions), positions.sum(axis=0).tolist()])
    if "rumba" not in archive.name:
        for _ in range(TRANSFORMS):
            index = choose.randrange(len(entries))
            time = moment(entries[index])
            transforms.append([index, time, entries[index].world(time)[:3].ravel().tolist()])
        meshes = [i for i, entry in enumerate(entries) if entry.kind == "Mesh"]
        for _ in range(VERTICES):
            index = choose.choice(meshes)
            time = moment(entries[index])
            positions = entries[index].positions(time)
            vertex = choose.randrange(len(positions))
            vertices.append([index, time, vertex, positions[vertex].tolist()])
    return {
        "paths": [entry.path for entry in entries],
        "key_times": [len(entry.key_times()) for entry in entries],
        "transforms": transforms,
        "vertices": vertices,
        "sums": sums,
    }


def short(value):
    """Ten decimals, so that nothing is lost at the tolerance of 1e-6 m."""
    if isinstance(value, float):
        return round(value, 10)
    if isinstance(value, list):
        return [short(item) for item in value]
    if isinstance(value, dict):
        return {key: short(item) for key, item in value.items()}
    return value


if __name__ == "__main__":
    (FOLDER / "data").mkdir(parents=True, exist_ok=True)
    for archive in sorted((data_folder() / "anim").glob("*.abc")):
        path = FOLDER / "data" / f"{archive.stem}.json"
        path.write_text(json.dumps(short(golden(archive)), separators=(",", ":")) + "\n")
        print(f"{path.name:32} {path.stat().st_size / 1000:8.1f} kB")
