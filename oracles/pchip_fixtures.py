"""Writes crates/froufrou/tests/fixtures/cloth/pchip.json: monotone cubics by SciPy.

Dev-only. Needs numpy and scipy from PyPI:

    pip install numpy scipy
    python oracles/pchip_fixtures.py
"""

import json
import pathlib

import numpy as np
from scipy.interpolate import PchipInterpolator

OUT = pathlib.Path(__file__).resolve().parent.parent / "crates/froufrou/tests/fixtures/cloth/pchip.json"
random = np.random.default_rng(5)
cases = []
for number in range(24):
    count = int(random.integers(3, 12))
    keys = np.cumsum(random.uniform(0.01, 1.0, count)) if number % 2 else np.arange(count) / 60
    values = random.normal(size=count)
    if number % 3 == 0:
        # Speeds: none below 0, and runs of 0 where nothing touches.
        values = np.where(random.uniform(size=count) < 0.4, 0, np.abs(values))
    if number % 5 == 0:
        values = np.sort(values)
    curve = PchipInterpolator(keys, values)
    at = np.sort(random.uniform(keys[0], keys[-1], 12))
    cases.append(
        {
            "keys": keys.tolist(),
            "values": values.tolist(),
            "slopes": curve.derivative()(keys).tolist(),
            "at": at.tolist(),
            "expected": curve(at).tolist(),
        }
    )
OUT.parent.mkdir(parents=True, exist_ok=True)
OUT.write_text("[\n" + ",\n".join(json.dumps(case) for case in cases) + "\n]\n")
