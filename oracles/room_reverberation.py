"""Prints how long rooms reverberate by images of a high order, beside the formulas of Eyring and Sabine.

Dev-only, and writes nothing. Needs numpy and pyroomacoustics (0.10) from PyPI:

    pip install numpy pyroomacoustics
    python oracles/room_reverberation.py

The time is measured between 5 and 35 dB below the start of Schroeder's curve, averaged over four pairs of places. Images
in a box decay more slowly than Eyring's formula says where its sides or walls differ much: sound that runs along the
longest side meets few walls.
"""

import numpy as np
import pyroomacoustics as pra

SPEED, RATE = 343.0, 16000
pra.constants.set("rir_hpf_enable", False)


def measured(response):
    curve = np.cumsum(response[::-1] ** 2)[::-1]
    level = 10 * np.log10(curve / curve[0] + 1e-20)
    within = (level <= -5) & (level >= -35)
    return -60 / np.polyfit(np.flatnonzero(within) / RATE, level[within], 1)[0]


rooms = [
    # size, absorption of left, right, floor, ceiling, front, back
    ("cube", [4.0, 4.0, 4.0], [0.3] * 6, 45),
    ("cube", [4.0, 4.0, 4.0], [0.1] * 6, 80),
    ("hall, walls alike", [18.0, 11.0, 25.0], [0.2] * 6, 45),
    ("hall, soft floor", [18.0, 9.0, 26.0], [0.13, 0.13, 0.40, 0.13, 0.13, 0.13], 60),
    ("corridor", [2.1, 2.6, 30.0], [0.2] * 6, 80),
]
rng = np.random.default_rng(1)
for name, size, absorption, order in rooms:
    size = np.array(size)
    walls = dict(zip(["west", "east", "south", "north", "floor", "ceiling"], map(pra.Material, absorption)))
    times = []
    for _ in range(4):
        room = pra.ShoeBox(size, fs=RATE, materials=walls, max_order=order, air_absorption=False)
        room.set_sound_speed(SPEED)
        room.add_source(size * rng.uniform(0.1, 0.9, 3))
        room.add_microphone(size * rng.uniform(0.1, 0.9, 3))
        room.compute_rir()
        times.append(measured(room.rir[0][0]))
    areas = np.array([size[1] * size[2]] * 2 + [size[0] * size[2]] * 2 + [size[0] * size[1]] * 2)
    mean, volume = (areas * absorption).sum() / areas.sum(), size.prod()
    eyring = pra.acoustics.rt60_eyring(areas.sum(), volume, mean, 0.0, SPEED)
    sabine = pra.acoustics.rt60_sabine(areas.sum(), volume, mean, 0.0, SPEED)
    images = np.mean(times)
    print(
        f"{name}: images {images:.2f} s, Eyring {eyring:.2f} s ({100 * (eyring / images - 1):+.0f} %),"
        f" Sabine {sabine:.2f} s ({100 * (sabine / images - 1):+.0f} %)",
        flush=True,
    )
