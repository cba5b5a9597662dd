"""Thins simulated cloth and paper of the test data to what examples need: some of its vertices and every second frame, as point
caches.

Dev-only. Needs numpy and alembic3d from PyPI, and the test data's animations (simulated in Blender by make_animations.py):

    pip install numpy alembic3d==1.8.12.1
    python examples/make_meshes.py ../shared/data/anim
"""

import pathlib
import sys

import numpy as np
from alembic3d import Abc, AbcGeom

HERE = pathlib.Path(__file__).resolve().parent
ANIMATIONS = pathlib.Path(sys.argv[1])
EVERY_FRAME, FPS = 2, 60


def thin(animation, name, columns, rows, every, to):
    """Writes a grid of vertices, row by row, and its faces."""
    top = Abc.IArchive(str(ANIMATIONS / animation)).getTop()
    positions = AbcGeom.IPolyMesh(top.getChild(name), name).getSchema().getPositionsProperty()
    to_world = AbcGeom.IXform(top, name).getSchema().getValue().getMatrix()
    to_world = np.array([[to_world[i][j] for j in range(4)] for i in range(4)])
    frames = []
    for frame in range(0, positions.getNumSamples(), EVERY_FRAME):
        # Its selector takes seconds; the first sample is frame 1.
        sample = positions.getValue(Abc.ISampleSelector(float((frame + 1) / FPS)))
        points = np.array([[v[0], v[1], v[2], 1] for v in sample]) @ to_world
        grid = points[:, :3].reshape(rows, columns, 3)
        frames.append(grid[::every, ::every].reshape(-1, 3))
    frames = np.array(frames, dtype="<f4")
    count, vertices, _ = frames.shape
    header = b"POINTCACHE2\0" + np.array([1, vertices], "<i4").tobytes()
    header += np.array([1, 1], "<f4").tobytes() + np.array([count], "<i4").tobytes()
    to.with_suffix(".pc2").write_bytes(header + frames.tobytes())
    columns, rows = (columns - 1) // every + 1, (rows - 1) // every + 1
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in frames[0]]
    for row in range(rows - 1):
        for column in range(columns - 1):
            first = row * columns + column + 1
            lines.append(f"f {first} {first + 1} {first + columns + 1} {first + columns}")
    to.with_suffix(".obj").write_text("\n".join(lines) + "\n")


thin("sheet.abc", "Sheet", 49, 49, 4, HERE / "cloth/sheet")
thin("flag.abc", "Flag", 49, 33, 4, HERE / "flag/flag")
thin("paper_flip.abc", "Paper", 29, 21, 2, HERE / "paper-flip/paper")
thin("paper_slide.abc", "Paper", 29, 21, 2, HERE / "paper-slide/paper")

# The floor under the sheet, and the cylinder that lies along z.
around = 48
turns = 2 * np.pi * np.arange(around) / around
lines = ["o floor", "v -3 0 -3", "v -3 0 3", "v 3 0 3", "v 3 0 -3", "f 1 2 3 4", "o cylinder"]
for z in (-0.8, 0.8):
    lines += [f"v {1 + 0.18 * np.cos(a):.4f} {0.22 + 0.18 * np.sin(a):.4f} {z}" for a in turns]
for k in range(around):
    a, b = 5 + k, 5 + (k + 1) % around
    lines.append(f"f {a} {b} {b + around} {a + around}")
(HERE / "cloth/room.obj").write_text("\n".join(lines) + "\n")
