"""Impulse responses of the filters of procedures, by scipy.

pip install numpy scipy
python oracles/procedure_filters.py > crates/froufrou/tests/fixtures/procedure_filters.json

Each filter is the analogue one put through scipy's bilinear transform, with its cut-off kept in place.
"""

import json

import numpy as np
from scipy import signal

RATE_HZ = 48000.0
COUNT = 48


def response(numerator, denominator):
    """Of an analogue filter in s / (2 pi cutoff)."""
    impulse = np.zeros(COUNT)
    impulse[0] = 1.0
    return signal.lfilter(numerator, denominator, impulse).tolist()


def digital(shape, cutoff_hz, q=None):
    warped = 2 * RATE_HZ * np.tan(np.pi * cutoff_hz / RATE_HZ)
    if q is None:
        numerator = {"lowpass1": [warped], "highpass1": [1, 0]}[shape]
        denominator = [1, warped]
    else:
        numerator = {
            "lowpass": [warped**2],
            "highpass": [1, 0, 0],
            "bandpass": [warped / q, 0],
        }[shape]
        denominator = [1, warped / q, warped**2]
    return response(*signal.bilinear(numerator, denominator, RATE_HZ))


cases = []
for shape in ["lowpass1", "highpass1"]:
    for cutoff_hz in [120.0, 3000.0, 20000.0]:
        cases.append((shape, cutoff_hz, None))
for shape in ["lowpass", "highpass", "bandpass"]:
    for cutoff_hz, q in [(120.0, 0.7071067811865476), (3000.0, 0.5), (3000.0, 30.0), (20000.0, 2.0)]:
        cases.append((shape, cutoff_hz, q))

rows = [
    {"shape": shape, "cutoff_hz": cutoff_hz, "q": q, "response": digital(shape, cutoff_hz, q)}
    for shape, cutoff_hz, q in cases
]
print("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]")
