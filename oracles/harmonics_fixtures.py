"""Writes the spherical harmonics that the test of directivity.rs reads, as SciPy has them.

Dev-only. Needs numpy and scipy (1.15 or later) from PyPI:

    pip install numpy scipy
    python oracles/harmonics_fixtures.py

Each row: a unit vector (ahead, left, up), then the 16 real harmonics to order 3 in ACN order, SN3D. They are
made from SciPy's complex ones: real ones without the Condon-Shortley phase, times sqrt(4 pi / (2n + 1)).
"""

import pathlib

import numpy as np
from scipy.special import sph_harm_y

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/harmonics.tsv"


def real(n, m, polar, azimuth):
    y = sph_harm_y(n, abs(m), polar, azimuth) * np.sqrt(4 * np.pi / (2 * n + 1))
    if m == 0:
        return y.real
    return np.sqrt(2) * (-1) ** m * (y.real if m > 0 else y.imag)


rng = np.random.default_rng(3)
directions = rng.normal(size=(20, 3))
directions = np.concatenate([directions, np.eye(3), -np.eye(3)])
directions /= np.linalg.norm(directions, axis=1, keepdims=True)
lines = ["# ahead, left, up, then 16 harmonics: ACN, SN3D (oracles/harmonics_fixtures.py)"]
for x, y, z in directions:
    polar, azimuth = np.arccos(z), np.arctan2(y, x)
    values = [real(n, m, polar, azimuth) for n in range(4) for m in range(-n, n + 1)]
    lines.append("\t".join(f"{v:.16g}" for v in [x, y, z, *values]))
OUT.write_text("\n".join(lines) + "\n")
