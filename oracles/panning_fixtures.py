"""Writes the gains that the tests of panning and ambisonic decoding read, as NumPy and SciPy have them.

Dev-only. Needs numpy, scipy (1.15 or later) and spaudiopy from PyPI:

    pip install numpy scipy spaudiopy
    python oracles/panning_fixtures.py

Vectors are in the listener's frame: ahead -Z, right +X, up +Y.

panning.tsv: rows `layout` with azimuths and elevations in degrees, then rows `gains` with a unit vector and the
gain of each loudspeaker. They come from a brute force: of all triplets of loudspeakers (pairs, where all are in one
plane) that no other loudspeaker lies outside of, the one that has no gain below 0. Faces of SciPy's hull that lie in
one plane have an imaginary loudspeaker amid them. Where all faces are triangles, spaudiopy is asked too.

decoders.tsv: rows `layout` as above, then rows `basic` (the pseudo-inverse, N3D, without a level) and `allrad` (3rd
order, max-rE, mean energy 1): the gain of each loudspeaker from each of 16 harmonics, a loudspeaker after the other.
"""

import itertools
import pathlib

import numpy as np
from scipy.spatial import ConvexHull
from scipy.special import eval_legendre, sph_harm_y

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures"
rng = np.random.default_rng(11)


def vector(azimuth, elevation):
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.stack([-np.sin(a) * np.cos(e), np.sin(e), -np.cos(a) * np.cos(e)], axis=-1)


def faces(points):
    """Hull faces as sets of corners, those in one plane joined."""
    hull = ConvexHull(points)
    assert np.all(hull.equations[:, 3] < -0.2), "the listener is well inside"
    joined = {}
    for corners, equation in zip(hull.simplices, hull.equations):
        joined.setdefault(tuple(np.round(equation, 6) + 0.0), set()).update(corners)
    return [sorted(corners) for corners in joined.values()]


def triplets(points):
    """The triplets that no other loudspeaker lies outside of, by trying all, with what each corner means."""
    found = []
    meaning = [np.eye(len(points))[i] for i in range(len(points))]
    corners = [p for p in points]
    for face in faces(points):
        if len(face) == 3:
            continue
        total = points[face].sum(axis=0)
        length = np.linalg.norm(total)
        corners.append(total / length)
        weights = np.zeros(len(points))
        weights[face] = 1 / length
        meaning.append(weights)
        for a, b in itertools.combinations(face, 2):
            normal = np.cross(points[a], points[b])
            sides = points[face] @ normal
            if np.all(sides > -1e-9) or np.all(sides < 1e-9):
                found.append((a, b, len(corners) - 1))
    for triplet in itertools.combinations(range(len(points)), 3):
        a, b, c = points[list(triplet)]
        normal = np.cross(b - a, c - a)
        outside = (points - a) @ normal * np.sign(a @ normal)
        if np.sum(outside > -1e-9) == 3 and outside.max() < 1e-9:
            found.append(triplet)
    return np.array(corners), np.array(meaning), found


def pan(points, directions):
    corners, meaning, all_triplets = triplets(points)
    best = np.full(len(directions), -np.inf)
    gains = np.zeros((len(directions), len(points)))
    for triplet in all_triplets:
        triplet = list(triplet)
        g = np.linalg.solve(corners[triplet].T, directions.T).T
        better = g.min(axis=1) > best
        best[better] = g.min(axis=1)[better]
        gains[better] = (np.maximum(g, 0) @ meaning[triplet])[better]
    assert best.min() > -1e-9
    return gains / np.linalg.norm(gains, axis=1, keepdims=True)


def pan_ring(azimuths, directions):
    """All pairs; the one with the least angle that has no gain below 0."""
    points = vector(np.array(azimuths), np.zeros(len(azimuths)))[:, [0, 2]]
    out = []
    for direction in directions:
        usable = []
        for pair in itertools.combinations(range(len(points)), 2):
            pair = list(pair)
            basis = points[pair]
            if abs(np.linalg.det(basis)) > 1e-9:
                g = np.linalg.solve(basis.T, direction[[0, 2]])
                if g.min() > -1e-12:
                    usable.append((-basis[0] @ basis[1], pair, g))
        _, pair, g = min(usable, key=lambda u: u[0])
        gains = np.zeros(len(points))
        gains[pair] = g / np.linalg.norm(g)
        out.append(gains)
    return np.array(out)


def sphere(count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def angles(points):
    azimuth = np.degrees(np.arctan2(-points[:, 0], -points[:, 2]))
    return np.stack([azimuth, np.degrees(np.arcsin(points[:, 1]))], axis=1)


def row(word, numbers):
    return "\t".join([word, *(f"{v:.16g}" for v in np.ravel(numbers))])


def spread_out(count):
    """Random places that surround the listener, none near another."""
    while True:
        places = np.round(angles(sphere(count)), 1)
        points = vector(places[:, 0], places[:, 1])
        apart = points @ points.T - 2 * np.eye(count)
        if apart.max() < 0.9 and ConvexHull(points).equations[:, 3].max() < -0.25:
            return places


def harmonics_n3d(directions):
    """16 harmonics in ACN order, from SciPy's complex ones without the Condon-Shortley phase."""
    polar, azimuth = np.arccos(directions[:, 1]), np.arctan2(-directions[:, 0], -directions[:, 2])
    out = []
    for n in range(4):
        for m in range(-n, n + 1):
            y = sph_harm_y(n, abs(m), polar, azimuth) * np.sqrt(4 * np.pi)
            root = np.sqrt(2) * (-1) ** m
            out.append(y.real if m == 0 else root * (y.real if m > 0 else y.imag))
    return np.array(out)


orders = np.array([n for n in range(4) for _ in range(2 * n + 1)])

cube = np.array([(a, e) for e in (35.264389682754654, -35.264389682754654) for a in (45, -45, 135, -135)])
prism = np.array([(a, e) for e in (35, -35) for a in (0, 72, 144, 216, 288)])
random = [spread_out(12), spread_out(20)]

lines = ["# Gains of loudspeakers (oracles/panning_fixtures.py)"]
for places in [cube, prism, *random]:
    points = vector(places[:, 0], places[:, 1])
    directions = sphere(60)
    gains = pan(points, directions)
    if all(len(face) == 3 for face in faces(points)):
        import spaudiopy

        setup = spaudiopy.decoder.LoudspeakerSetup(*points.T)
        assert np.abs(spaudiopy.decoder.vbap(directions, setup) - gains).max() < 1e-9
        print("spaudiopy agrees")
    lines.append(row("layout", places))
    lines += [row("gains", [*d, *g]) for d, g in zip(directions, gains)]
for azimuths in [[45, -45, 135, -135], [30, -30, 0, 110, -110], [10, 100, -170, -50]]:
    lines.append(row("layout", [(a, 0) for a in azimuths]))
    directions = vector(np.linspace(-180, 180, 25) + 1.234, np.zeros(25))
    lines += [row("gains", [*d, *g]) for d, g in zip(directions, pan_ring(azimuths, directions))]
(OUT / "panning.tsv").write_text("\n".join(lines) + "\n")

# An even spiral of many virtual loudspeakers, unlike the rings of the crate.
count = 20000
up = 1 - (2 * np.arange(count) + 1) / count
turn = np.arange(count) * np.pi * (3 - 5**0.5)
around = np.sqrt(1 - up**2)
virtual = np.stack([around * np.cos(turn), up, around * np.sin(turn)], axis=1)
sharpest = max(np.polynomial.legendre.legroots([0, 0, 0, 0, 1]))
max_re = eval_legendre(orders, sharpest)

lines = ["# Decoders (oracles/panning_fixtures.py)"]
for places in [*random, cube]:
    points = vector(places[:, 0], places[:, 1])
    lines.append(row("layout", places))
    lines.append(row("basic", np.linalg.pinv(harmonics_n3d(points), rcond=0.01)))
    decoder = pan(points, virtual).T @ harmonics_n3d(virtual).T / count * max_re
    decoder /= np.sqrt(np.sum(decoder**2))
    lines.append(row("allrad", decoder))
(OUT / "decoders.tsv").write_text("\n".join(lines) + "\n")
