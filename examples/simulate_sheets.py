"""Simulates the sheets of four examples, a skirt about a dancer, two sleeves about arms that box, and paper that is shaken,
by position-based dynamics (Müller et al. 2007): points that keep their distances, and are pushed out of capsules.

Dev-only. Needs numpy:

    pip install numpy
    python examples/simulate_sheets.py

Writes `dress/`, `sleeves/`, `paper-shake/` and `paper-wall/`: sheets and bodies as point caches (PC2) at 30 frames a
second, with their faces.
"""

import pathlib

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
FPS, SUBSTEPS, ROUNDS = 30, 16, 6
GRAVITY = np.array([0.0, -9.81, 0.0])
THICKNESS = 0.004


def links(rows, columns, offset, closed=True, bend=0.0005, shear=0.1):
    """Pairs of points of a tube or a sheet, in sets in which no point comes twice: along, around, across, and over the next."""
    at = lambda row, column: offset + row * columns + column % columns
    sets = {}
    for row in range(rows):
        for column in range(columns):
            for name, (down, right), stiffness in (
                ("around", (0, 1), 1.0),
                ("along", (1, 0), 1.0),
                ("across", (1, 1), shear),
                ("back", (1, -1), shear),
                ("bend around", (0, 2), bend),
                ("bend along", (2, 0), bend),
            ):
                if row + down < rows and (closed or 0 <= column + right < columns):
                    # Four colours suffice where the number of columns is a multiple of four.
                    key = (name, (row // max(down, 1)) % 2, (column // max(abs(right), 1)) % 2, stiffness)
                    sets.setdefault(key, []).append((at(row, column), at(row + down, column + right)))
    return [(np.array(pairs), key[3]) for key, pairs in sets.items()]


def tube_faces(rows, columns, offset):
    faces = []
    for row in range(rows - 1):
        for column in range(columns):
            a, b = row * columns + column, row * columns + (column + 1) % columns
            faces.append([offset + i + 1 for i in (a, b, b + columns, a + columns)])
    return faces


def push_out(points, before, capsules, capsules_before, friction):
    """Moves points out of capsules, which drag along what they touch."""
    for (a, b, radius), (a0, b0, _) in zip(capsules, capsules_before):
        way = b - a
        along = np.clip(((points - a) @ way) / (way @ way), 0, 1)[:, None]
        nearest = a + along * way
        away = points - nearest
        distance = np.linalg.norm(away, axis=1)
        inside = distance < radius + THICKNESS
        if not inside.any():
            continue
        normal = away[inside] / np.maximum(distance[inside], 1e-9)[:, None]
        out = nearest[inside] + normal * (radius + THICKNESS)
        carried = nearest[inside] - (a0 + along[inside] * (b0 - a0))
        slid = out - before[inside] - carried
        slid -= (slid * normal).sum(1)[:, None] * normal
        points[inside] = out - friction * slid


def simulate(rest, sets, body, held, seconds, drag=0.6):
    """Frames of points. `body(t)` gives capsules, `held(t)` the numbers and places of points that are led."""
    lengths = [np.linalg.norm(rest[p[:, 0]] - rest[p[:, 1]], axis=1) for p, _ in sets]
    points, velocity, step = rest.copy(), np.zeros_like(rest), 1 / (FPS * SUBSTEPS)
    frames, time = [], -1.0  # It settles for a second.
    while len(frames) < round(seconds * FPS):
        for _ in range(SUBSTEPS):
            before, capsules_before = points.copy(), body(max(time, 0))
            time += step
            capsules = body(max(time, 0))
            velocity = (velocity + step * GRAVITY) * np.exp(-drag * step)
            points = before + step * velocity
            led, places = held(max(time, 0))
            for _ in range(ROUNDS):
                for (pairs, stiffness), length in zip(sets, lengths):
                    i, j = pairs[:, 0], pairs[:, 1]
                    way = points[j] - points[i]
                    now = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
                    move = (0.5 * stiffness * (now - length) / now)[:, None] * way
                    points[i] += move
                    points[j] -= move
                points[led] = places
            push_out(points, before, capsules, capsules_before, 0.3)
            points[led] = places
            velocity = (points - before) / step
        if time > 0:
            frames.append(points.copy())
    return np.array(frames)


def capsule_mesh(a, b, radius, columns=8, rings=2):
    """Points of a capsule: rings about its middle line, and of its two caps."""
    way = (b - a) / np.linalg.norm(b - a)
    side = np.cross(way, [0.3, 0.2, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(way, side)
    turns = 2 * np.pi * np.arange(columns) / columns
    about = np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * up
    profile = [(-radius * np.sin(w), radius * np.cos(w), a) for w in (1.45, 0.75)]
    profile += [(s * np.linalg.norm(b - a), radius, a) for s in np.linspace(0, 1, rings)]
    profile += [(radius * np.sin(w), radius * np.cos(w), b) for w in (0.75, 1.45)]
    return np.concatenate([base + along * way + wide * about for along, wide, base in profile])


def write(to, frames, faces):
    frames = np.asarray(frames, dtype="<f4")
    count, vertices, _ = frames.shape
    header = b"POINTCACHE2\0" + np.array([1, vertices], "<i4").tobytes()
    header += np.array([1, 1], "<f4").tobytes() + np.array([count], "<i4").tobytes()
    to.parent.mkdir(exist_ok=True)
    to.with_suffix(".pc2").write_bytes(header + frames.tobytes())
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in frames[0]]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    to.with_suffix(".obj").write_text("\n".join(lines) + "\n")
    print(to.with_suffix(".pc2"), frames.nbytes // 1000, "kB")


def write_body(to, body, seconds):
    capsules = len(body(0.0))
    frames = [np.concatenate([capsule_mesh(*c) for c in body(f / FPS)]) for f in range(round(seconds * FPS))]
    write(to, frames, [face for c in range(capsules) for face in tube_faces(6, 8, c * 48)])


def dress():
    """A dancer turns one way, stops, and turns the other way; her skirt flies out and wraps her legs."""
    seconds, columns, rows = 5, 24, 8
    turn = lambda t: (2.2 * np.sin(2 * np.pi * t / 2.5) + 0.7 * np.sin(2 * np.pi * t / 0.8)) * min(1, t / 0.3)

    def around(points, t):
        c, s = np.cos(turn(t)), np.sin(turn(t))
        sway = np.array([0.06 * np.sin(2 * np.pi * t / 1.25), 0, 0])
        return points @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + sway

    def body(t):
        lift = 0.22 * np.sin(2 * np.pi * t / 1.25)
        ends = np.array([[-0.06, 1, 0], [0.06, 1, 0], [-0.09, 0.9, 0], [-0.1, 0.2, -lift], [0.09, 0.9, 0], [0.1, 0.2, lift]])
        ends = around(ends, t)
        return [(ends[0], ends[1], 0.12), (ends[2], ends[3], 0.075), (ends[4], ends[5], 0.075)]

    turns = 2 * np.pi * np.arange(columns) / columns
    wide = 0.18 + 0.17 * np.linspace(0, 1, rows) ** 0.8
    rest = np.array([[w * np.cos(a), 1.04 - 0.65 * row / (rows - 1), w * np.sin(a)] for row, w in enumerate(wide) for a in turns])
    waist = np.arange(columns)
    held = lambda t: (waist, around(rest[waist], t))
    frames = simulate(rest, links(rows, columns, 0), body, held, seconds)
    write(HERE / "dress/skirt", frames, tube_faces(rows, columns, 0))
    write_body(HERE / "dress/dancer", body, seconds)


def sleeves():
    """Two arms box in turn, left and right of the head that hears them."""
    seconds, columns, rows = 4, 12, 12
    upper, fore = 0.28, 0.26

    def arm(side, t):
        shoulder = np.array([0.19 * side, 1.42, 0.0])
        # A punch a second and arm, out in 0.15 s and back in 0.25 s.
        phase = (t + (0.5 if side > 0 else 0.0)) % 1.0
        out = np.interp(phase, [0, 0.05, 0.2, 0.45, 1], [0, 0, 1, 0, 0])
        out = out * out * (3 - 2 * out)
        fist = (1 - out) * np.array([0.14 * side, 1.32, -0.26]) + out * np.array([0.06 * side, 1.40, -0.50])
        way = fist - shoulder
        reach = np.linalg.norm(way)
        along = (upper**2 - fore**2 + reach**2) / (2 * reach)
        bend = np.array([0.5 * side, -1.0, 0.2])
        bend -= (bend @ way) * way / reach**2
        bend /= np.linalg.norm(bend)
        elbow = shoulder + along * way / reach + np.sqrt(max(upper**2 - along**2, 0)) * bend
        return shoulder, elbow, fist

    def tube(side, t):
        """Where the sleeve would be if it were stiff: rings about the arm, wide at the elbow."""
        shoulder, elbow, fist = arm(side, t)
        points = []
        for row in range(rows):
            s = row / (rows - 1) * (upper + fore)
            middle = shoulder + (elbow - shoulder) * s / upper if s < upper else elbow + (fist - elbow) * (s - upper) / fore
            way = (elbow - shoulder) if s < upper else (fist - elbow)
            way = way / np.linalg.norm(way)
            outward = np.array([side, 0.0, 0.0]) - side * way[0] * way
            outward /= np.linalg.norm(outward)
            other = np.cross(way, outward)
            for a in 2 * np.pi * np.arange(columns) / columns:
                points.append(middle + 0.062 * (np.cos(a) * outward + np.sin(a) * other))
        return np.array(points)

    def body(t):
        capsules = []
        for side in (-1, 1):
            shoulder, elbow, fist = arm(side, t)
            capsules += [(shoulder, elbow, 0.045), (elbow, fist, 0.036)]
        return capsules

    count = rows * columns
    rest = np.concatenate([tube(-1, 0.0), tube(1, 0.0)])
    ends = np.concatenate([np.arange(columns), count - columns + np.arange(columns)])
    ends = np.concatenate([ends, ends + count])
    held = lambda t: (ends, np.concatenate([tube(-1, t), tube(1, t)])[ends])
    sets = links(rows, columns, 0) + links(rows, columns, count)
    frames = simulate(rest, sets, body, held, seconds)
    write(HERE / "sleeves/sleeves", frames, tube_faces(rows, columns, 0) + tube_faces(rows, columns, count))
    write_body(HERE / "sleeves/arms", body, seconds)


def paper(name, path, seconds):
    """A sheet of A4 hangs from its two upper corners and is shaken, on its way along a path."""
    columns, rows = 11, 15
    across, down = np.linspace(-0.105, 0.105, columns), np.linspace(0, -0.297, rows)
    rest = np.array([[x, y, 0.0] for y in down for x in across])
    corners = np.array([0, 1, columns - 2, columns - 1])

    def held(t):
        # Two shakes a second, three times; and the corners come nearer to each other, so that it bows.
        shakes = sum(np.clip((t - start) / 0.2, 0, 1) * np.clip((start + 0.9 - t) / 0.2, 0, 1) for start in (0.3, 1.7, 3.1))
        to_and_fro = 0.05 * shakes * np.sin(2 * np.pi * 4 * t)
        places = rest[corners] * [0.93, 1, 1] + [0, 0.02 * shakes * np.sin(2 * np.pi * 8 * t), to_and_fro]
        return corners, places + path(t)

    sets = links(rows, columns, 0, closed=False, bend=0.6, shear=1.0)
    frames = simulate(rest + path(0.0), sets, lambda t: [], held, seconds, drag=3.0)
    faces = [[row * columns + i + 1 for i in (c, c + 1, c + 1 + columns, c + columns)] for row in range(rows - 1) for c in range(columns - 1)]
    write(HERE / name / "paper", frames, faces)


dress()
sleeves()
paper("paper-shake", lambda t: np.array([0.0, 1.4, 0.0]), 4.5)
# Towards a wall at z = 0, and back.
paper("paper-wall", lambda t: np.array([0.0, 1.4, 1.0 - 0.85 * np.sin(np.pi * t / 4.5) ** 2]), 4.5)
