"""Writes contacts.csv.gz: a hand rubs a block of sandpaper to and fro on a board, then a finger on a wet pane.

    python examples/sandpaper/make_contacts.py

A row for each contact and 5 ms: time, the two bodies, place, normal force and the velocity of the one along
the other, as a rigid-body simulation would log them.
"""

import gzip
import math
import pathlib

STEP = 0.005
# Strokes of the block: begin and end in seconds, centimetres they go, newtons.
STROKES = [(0.3, 1.1, 20, 8), (1.2, 2.0, -20, 8), (2.1, 2.6, 20, 12), (2.65, 3.15, -20, 12), (3.2, 3.5, 20, 14), (3.53, 3.83, -20, 14)]
# Of the finger.
SQUEAKS = [(4.6, 5.3, 12, 2), (5.6, 6.0, -10, 3), (6.2, 6.5, 8, 3), (6.6, 6.8, -6, 2)]


def rows(a, b, origin, strokes):
    """A stroke begins and ends at rest: its speed is a half wave of a sine, and so is the force."""
    x = origin[0]
    for begin, end, centimetres, force in strokes:
        length, way = end - begin, centimetres / 100
        for k in range(round(begin / STEP) + 1, round(end / STEP)):
            t = k * STEP
            part = (t - begin) / length
            speed = way / length * math.pi / 2 * math.sin(math.pi * part)
            place = x + way * (1 - math.cos(math.pi * part)) / 2
            press = force * (0.4 + 0.6 * math.sin(math.pi * part))
            yield t, a, b, place, origin[1], origin[2], press, speed
        x += way


def main():
    log = sorted([*rows("block", "board", (-0.6, 0.8, 0), STROKES), *rows("finger", "pane", (0.5, 1, 0), SQUEAKS)])
    lines = ["t,a,b,x,y,z,force,vx"]
    lines += [f"{t:.3f},{a},{b},{x:.4f},{y:g},{z:g},{n:.3f},{v:.4f}" for t, a, b, x, y, z, n, v in log]
    # Without a time stamp and a name the bytes depend on the rows alone.
    with open(pathlib.Path(__file__).parent / "contacts.csv.gz", "wb") as file:
        with gzip.GzipFile("", "wb", 9, file, 0) as packed:
            packed.write(("\n".join(lines) + "\n").encode())


if __name__ == "__main__":
    main()
