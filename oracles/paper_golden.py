"""Golden values of the quadratic-chi distance (Pele & Werman 2010), from its definition with whole matrices.

Writes crates/froufrou/tests/fixtures/paper/quadratic_chi.json. Needs numpy.

    python oracles/paper_golden.py
"""

import json
import pathlib

import numpy as np

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/paper/quadratic_chi.json"


def quadratic_chi(p, q, similarity, m):
    """As in section 3 of the paper: QC = sqrt(D A D'), D_i = (P_i - Q_i) / Z_i^m, 0/0 = 0."""
    z = (p + q) @ similarity
    z[z == 0] = 1
    d = (p - q) / z**m
    return np.sqrt(max(d @ similarity @ d, 0))


def similarity(count, reach):
    index = np.arange(count)
    return np.maximum(0, 1 - np.abs(index[:, None] - index[None, :]) / reach)


def histogram(magnitudes, spacing_hz):
    """Twelfths of an octave from 80 Hz, by the integral of a step function."""
    edges = 80 * 2 ** (np.arange(97) / 12)
    places = (np.arange(len(magnitudes) + 1) + 0.5) * spacing_hz
    below = np.concatenate([[0], np.cumsum(magnitudes)])
    bands = np.diff(np.interp(edges, places, below))
    return bands / bands.sum()


def rounded(values):
    return [float(f"{v:.10g}") for v in values]


random = np.random.default_rng(7)
cases = []
for count, reach, m in [(24, 1, 0.5), (24, 5, 0.5), (40, 12, 0.9), (17, 40, 0.0), (30, 3, 0.25)]:
    p, q = random.random(count) ** 3, random.random(count) ** 3
    # Runs that are empty in both.
    p[3:9], q[4:10] = 0, 0
    p, q = np.array(rounded(p / p.sum())), np.array(rounded(q / q.sum()))
    distance = quadratic_chi(p, q, similarity(count, reach), m)
    cases.append({"p": list(p), "q": list(q), "reach": reach, "m": m, "distance": float(distance)})

magnitudes = np.array(rounded(random.random(400)))
spacing_hz = 31.0
golden = {
    "cases": cases,
    "magnitudes": list(magnitudes),
    "spacing_hz": spacing_hz,
    "histogram": rounded(histogram(magnitudes, spacing_hz)),
}
OUT.parent.mkdir(exist_ok=True)
OUT.write_text(json.dumps(golden, indent=1).replace("\n   ", " ") + "\n")
