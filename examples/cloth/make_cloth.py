"""Thins the simulated sheet of the test data to what an example needs: every second vertex and frame, as a point cache.

Dev-only. Needs numpy and alembic3d from PyPI, and sheet.abc of the test data (simulated in Blender by make_animations.py):

    pip install numpy alembic3d==1.8.12.1
    python examples/cloth/make_cloth.py ../shared/data/anim/sheet.abc
"""

import pathlib
import sys

import numpy as np
from alembic3d import Abc, AbcGeom

HERE = pathlib.Path(__file__).resolve().parent
SIDE, THIN, FPS = 49, 2, 60

top = Abc.IArchive(sys.argv[1]).getTop()
positions = AbcGeom.IPolyMesh(top.getChild("Sheet"), "Sheet").getSchema().getPositionsProperty()
frames = []
for frame in range(0, positions.getNumSamples(), THIN):
    # Its selector takes seconds; the first sample is frame 1.
    sample = positions.getValue(Abc.ISampleSelector(float((frame + 1) / FPS)))
    grid = np.array([[v[0], v[1], v[2]] for v in sample]).reshape(SIDE, SIDE, 3)
    frames.append(grid[::THIN, ::THIN].reshape(-1, 3))
frames = np.array(frames, dtype="<f4")
count, vertices, _ = frames.shape
side = (SIDE + THIN - 1) // THIN
header = b"POINTCACHE2\0" + np.array([1, vertices], "<i4").tobytes()
header += np.array([1, 1], "<f4").tobytes() + np.array([count], "<i4").tobytes()
(HERE / "sheet.pc2").write_bytes(header + frames.tobytes())

lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in frames[0]]
for row in range(side - 1):
    for column in range(side - 1):
        first = row * side + column + 1
        lines.append(f"f {first} {first + 1} {first + side + 1} {first + side}")
(HERE / "sheet.obj").write_text("\n".join(lines) + "\n")

# The floor, and the cylinder that lies along z.
around = 48
turns = 2 * np.pi * np.arange(around) / around
lines = ["o floor", "v -3 0 -3", "v -3 0 3", "v 3 0 3", "v 3 0 -3", "f 1 2 3 4", "o cylinder"]
for z in (-0.8, 0.8):
    lines += [f"v {1 + 0.18 * np.cos(a):.4f} {0.22 + 0.18 * np.sin(a):.4f} {z}" for a in turns]
for k in range(around):
    a, b = 5 + k, 5 + (k + 1) % around
    lines.append(f"f {a} {b} {b + around} {a + around}")
(HERE / "room.obj").write_text("\n".join(lines) + "\n")
