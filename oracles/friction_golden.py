"""Friction spectra between measured speeds, and pops, by numpy: fixtures for `corpus::cloth`.

Needs numpy and scipy. Writes crates/froufrou/tests/fixtures/cloth/friction.json and pops.json:

    python oracles/friction_golden.py
"""

import json
import os

import numpy as np
from scipy.interpolate import interp1d
from scipy.ndimage import uniform_filter1d

OUT = os.path.join(os.path.dirname(__file__), "..", "crates", "froufrou", "tests", "fixtures", "cloth")
SPACING = 20.0


def interpolated(speeds, spectra, speed):
    """A(f, s) by tabulated functions: cumulative sums, their inverses, and a derivative by differences."""
    edges = (np.arange(len(spectra[0]) + 1) + 0.5) * SPACING
    if speed <= speeds[0]:
        return spectra[0] * (speed / speeds[0]) ** 2
    if speed >= speeds[-1]:
        return spectra[-1]
    j = int(np.searchsorted(speeds, speed, side="right"))
    alpha = (speed - speeds[j - 1]) / (speeds[j] - speeds[j - 1])
    totals = [s.sum() * SPACING for s in (spectra[j - 1], spectra[j])]
    distributions = [np.concatenate([[0], np.cumsum(s)]) / s.sum() for s in (spectra[j - 1], spectra[j])]
    levels = np.union1d(*distributions)
    levels = np.clip(levels, 0, 1)
    inverse = [interp1d(c, edges, bounds_error=False, fill_value=(edges[0], edges[-1]))(levels) for c in distributions]
    mixed = (1 - alpha) * inverse[0] + alpha * inverse[1]
    at_edges = np.interp(edges, mixed, levels)
    total = (1 - alpha) * totals[0] + alpha * totals[1]
    return total * np.diff(at_edges) / SPACING


def friction():
    rng = np.random.default_rng(5)
    n = 60
    f = (np.arange(n) + 1) * SPACING
    speeds = np.array([0.05, 0.2, 0.3])
    spectra = []
    for k, s in enumerate(speeds):
        centre = 200.0 + 1800.0 * s
        a = np.exp(-0.5 * ((f - centre) / (60.0 + 40 * k)) ** 2) + 0.02
        spectra.append(a * rng.uniform(0.5, 1.5, n) * 1e-3 * (1 + k))
    cases = []
    for s in [0.01, 0.05, 0.0875, 0.125, 0.19, 0.2, 0.24, 0.299, 0.3, 1.0]:
        cases.append({"speed_mps": s, "density": interpolated(speeds, spectra, s).tolist()})
    return {
        "spacing_hz": SPACING,
        "speeds_mps": speeds.tolist(),
        "measured": [s.tolist() for s in spectra],
        "expected": cases,
    }


def pops():
    rate, seconds = 8000, 1.0
    rng = np.random.default_rng(9)
    x = 0.002 * rng.standard_normal(int(rate * seconds))
    t = np.arange(len(x)) / rate
    for at, level, hz in [(0.12, 0.5, 700), (0.3, 0.2, 900), (0.31, 0.3, 1200), (0.55, 0.9, 500), (0.83, 0.05, 800)]:
        later = t - at
        x += np.where(later >= 0, level * np.exp(-250 * np.maximum(later, 0)) * np.sin(2 * np.pi * hz * later), 0)
    x = np.round(x * 32768) / 32768 + 0.0  # no -0
    box = int(round(0.02 * rate)) | 1
    # Sums of squares as of 96 kHz.
    energy = uniform_filter1d(x * x, box, mode="constant") * box * 96000 / rate
    threshold = 0.5
    above = np.concatenate([[0], (energy > threshold).astype(int), [0]])
    begins, ends = np.flatnonzero(np.diff(above) == 1), np.flatnonzero(np.diff(above) == -1)
    crossing = np.concatenate([[True], np.signbit(x[1:]) != np.signbit(x[:-1]), [True]])
    found = []
    for begin, end in zip(begins, ends):
        while not crossing[begin]:
            begin -= 1
        while not crossing[end]:
            end += 1
        found.append({"begin": int(begin), "end": int(end), "energy": float(np.sum(x[begin:end] ** 2) / rate)})

    # Histogram matching with 20 bins and distributions that are straight between their edges.
    sample = rng.exponential(1.0, 300)
    event = rng.gamma(2.0, 900.0, 500)

    def distribution(values):
        counts, edges = np.histogram(values, 20)
        return np.concatenate([[0], np.cumsum(counts)]) / len(values), edges

    (cs, es), (ce, ee) = distribution(sample), distribution(event)
    asked = np.quantile(event, [0.0, 0.01, 0.1, 0.33, 0.5, 0.77, 0.9, 0.93])
    matched = np.interp(np.interp(asked, ee, ce), cs, es)
    return {
        "rate_hz": rate,
        "samples_16_bit": (x * 32768).astype(int).tolist(),
        "threshold": threshold,
        "pops": found,
        "samples": sample.tolist(),
        "events": event.tolist(),
        "asked": asked.tolist(),
        "matched": matched.tolist(),
    }


def rounded(value):
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [rounded(v) for v in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


if __name__ == "__main__":
    os.makedirs(OUT, exist_ok=True)
    for name, made in [("friction", friction()), ("pops", pops())]:
        with open(os.path.join(OUT, f"{name}.json"), "w") as file:
            json.dump(rounded(made), file, separators=(",", ":"))
            file.write("\n")
        print(name, len(made.get("pops", made.get("expected", []))))
