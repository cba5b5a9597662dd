"""Writes the images of sources in rooms that the test of space/room reads, as pyroomacoustics has them.

Dev-only. Needs numpy and pyroomacoustics (0.10) from PyPI:

    pip install numpy pyroomacoustics
    python oracles/room_fixtures.py

In version 0.10 a source has the pressure 1 / d there as here (once it was 1 / (4 pi d)). The gains of images are the
product of sqrt(1 - absorption). For each room: its size, the absorption of each wall (left, right, floor, ceiling,
front, back) in eight bands, source and listener, the reverberation times of Sabine and Eyring, and of every image its
place, how many reflections it has and its gain in each band. For rooms that absorb all bands alike also the impulse
response at 16 kHz from source to listener: 81 taps of a sinc under Hann's window for each image, 40 of them
before it.
"""

import json
import pathlib

import numpy as np
import pyroomacoustics as pra

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/room"
SPEED = 343.0
# Its axes x, y, z with the ends low and high.
WALLS = ["west", "east", "south", "north", "floor", "ceiling"]

pra.constants.set("octave_bands_base_freq", 125.0)
# A response as it is, without a high pass.
pra.constants.set("rir_hpf_enable", False)


def flat(absorption):
    return [[absorption] * 8] * 6


uneven = [
    [0.02, 0.02, 0.03, 0.03, 0.04, 0.07, 0.07, 0.08],
    [0.30, 0.25, 0.15, 0.10, 0.10, 0.07, 0.06, 0.05],
    [0.05, 0.08, 0.20, 0.30, 0.35, 0.40, 0.45, 0.50],
    [0.50, 0.55, 0.60, 0.70, 0.80, 0.85, 0.80, 0.75],
    [0.10, 0.10, 0.10, 0.10, 0.10, 0.10, 0.10, 0.10],
    [0.00, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64],
]
rooms = [
    # name, size, absorption, source, listener, order
    ("cube", [4.0, 4.0, 4.0], flat(0.3), [1.1, 2.3, 0.9], [2.9, 1.7, 3.2], 4),
    ("corridor", [2.1, 2.6, 30.0], uneven, [0.7, 1.5, 4.0], [1.2, 1.6, 22.0], 4),
    ("corner", [7.0, 3.0, 5.0], flat(0.1), [0.05, 0.04, 4.97], [5.3, 1.2, 1.9], 3),
]
for name, size, absorption, source, listener, order in rooms:
    per_band = absorption[0][0] != absorption[0][-1]
    # 48 kHz has just eight bands; which frequencies they are does not matter here.
    rate = 48000 if per_band else 16000
    centres = [125.0 * 2**k for k in range(8)]
    materials = {
        wall: pra.Material({"coeffs": a, "center_freqs": centres} if per_band else a[0])
        for wall, a in zip(WALLS, absorption)
    }
    room = pra.ShoeBox(size, fs=rate, materials=materials, max_order=order, air_absorption=False)
    room.set_sound_speed(SPEED)
    room.add_source(source)
    room.add_microphone(listener)
    room.image_source_model()
    images = room.sources[0]
    rows = []
    for k in np.lexsort(np.round(images.images, 9))[::-1]:
        rows.append(
            {
                "position": [float(f"{v:.9g}") for v in images.images[:, k]],
                "order": int(images.orders[k]),
                "gains": [float(f"{v:.9g}") for v in (images.damping[:, k] if per_band else images.damping[:, k][:1])],
            }
        )
    volume = float(np.prod(size))
    areas = np.array([size[1] * size[2]] * 2 + [size[0] * size[2]] * 2 + [size[0] * size[1]] * 2)
    mean = (areas[:, None] * np.array(absorption)).sum(0) / areas.sum()
    air = np.array([1e-4 * 2**k for k in range(8)])
    fixture = {
        "size": size,
        "absorption": absorption,
        "source": source,
        "listener": listener,
        "order": order,
        "speed_of_sound": SPEED,
        "air_per_m": air.tolist(),
        "sabine": [pra.acoustics.rt60_sabine(areas.sum(), volume, a, m, SPEED) for a, m in zip(mean, air)],
        # Without air: its formula subtracts what air absorbs (version 0.10.1).
        "eyring": [pra.acoustics.rt60_eyring(areas.sum(), volume, a, 0.0, SPEED) for a in mean],
        "images": rows,
    }
    if not per_band:
        room.compute_rir()
        fixture["response"] = [float(f"{v:.6g}") for v in room.rir[0][0]]
    text = json.dumps(fixture)
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / f"{name}.json").write_text(text.replace('{"position"', '\n{"position"') + "\n")
    print(name, len(rows), "images", len(text), "bytes")
