#!/usr/bin/env python3
"""Holds every transform and vertex of every frame, as froufrou reads them, against alembic3d.

    pip install alembic3d==1.8.12.1 numpy
    python oracles/alembic_compare.py [ARCHIVE.abc ...]

Without arguments it takes all archives in the test data: $FROUFROU_DATA/anim, or ../shared/data/anim
beside the repository. Prints the largest difference of each file; ends with 1 if one exceeds
1e-6 m. Builds the example `alembic_dump` first.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import alembic_dump

ROOT = Path(__file__).resolve().parent.parent
TOLERANCE = 1e-6


def data_folder():
    return Path(os.environ.get("FROUFROU_DATA", ROOT / "../shared/data"))


class Dump:
    """A dump, read back in the order it was written."""

    def __init__(self, path, vertex_type):
        self.objects = json.loads(path.with_suffix(".json").read_text())
        self.bytes = path.with_suffix(".bin").read_bytes()
        self.vertex_type = np.dtype(vertex_type)
        self.taken = 0

    def moment(self, vertices):
        matrix = self.take(np.dtype("<f8"), 16)
        return matrix, self.take(self.vertex_type, 3 * vertices)

    def take(self, kind, count):
        values = np.frombuffer(self.bytes, kind, count, self.taken)
        self.taken += kind.itemsize * count
        return values.astype(float)


def compare(archive, folder):
    ours, theirs = folder / "ours", folder / "theirs"
    run = ["cargo", "run", "--release", "--quiet", "--package", "froufrou", "--example", "alembic_dump"]
    subprocess.run([*run, "--", str(archive.resolve()), str(ours)], check=True, cwd=ROOT)
    alembic_dump.dump(archive, theirs)
    ours, theirs = Dump(ours, "<f4"), Dump(theirs, "<f8")
    assert [o["path"] for o in ours.objects] == [o["path"] for o in theirs.objects]
    off_matrix = off_vertex = 0.0
    moments = total = 0
    for a, b in zip(ours.objects, theirs.objects):
        assert a["kind"] == b["kind"] and a["vertices"] == b["vertices"], a["path"]
        times_a, times_b = np.array(a["key_times_s"]), np.array(b["key_times_s"])
        assert times_a.shape == times_b.shape and np.all(np.abs(times_a - times_b) < 1e-9), a["path"]
        for count in a["vertices"]:
            (matrix_a, vertices_a), (matrix_b, vertices_b) = ours.moment(count), theirs.moment(count)
            off_matrix = max(off_matrix, np.max(np.abs(matrix_a - matrix_b)))
            if count:
                off_vertex = max(off_vertex, np.max(np.abs(vertices_a - vertices_b)))
            moments, total = moments + 1, total + count
    assert ours.taken == len(ours.bytes) and theirs.taken == len(theirs.bytes)
    print(
        f"{archive.name:28} {len(ours.objects):3} objects {moments:6} transforms {total:9} vertices: "
        f"largest difference {off_matrix:.1e} in a matrix, {off_vertex:.1e} m in a vertex"
    )
    # A NaN fails too.
    return off_matrix <= TOLERANCE and off_vertex <= TOLERANCE


if __name__ == "__main__":
    archives = [Path(name) for name in sys.argv[1:]] or sorted((data_folder() / "anim").glob("*.abc"))
    if not archives:
        sys.exit(f"no archives in {data_folder() / 'anim'}")
    with tempfile.TemporaryDirectory() as folder:
        sound = [compare(archive, Path(folder)) for archive in archives]
    sys.exit(0 if all(sound) else 1)
