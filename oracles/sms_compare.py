"""Splits real recordings with sms-tools and writes what its residuals hold, which a test reads.

Dev-only. Needs sms-tools and soundfile from PyPI, which want an old numpy and so an environment of their own, and the
project's folder of recordings:

    python -m venv sms && sms/bin/pip install sms-tools soundfile
    FROUFROU_DATA=../shared/data sms/bin/python oracles/sms_compare.py

sms_residuals.tsv: the recording (the average of its channels, its first three seconds), the hop in samples, the mean
number of sinusoids that sound at once and the energy of the residual in dB below the recording. sms-tools has its own
defaults (at most 100 sinusoids, of 20 ms at least, that move by 20 Hz + 1 % a frame; a hop of 128 samples, synthesis by
512), the window has 46 ms, and of Hamming's and Blackman and Harris's that which leaves less.
"""

import os
import pathlib
import warnings

import numpy as np
import soundfile
from scipy.signal import get_window

warnings.simplefilter("ignore")
from smstools.models import sineModel, utilFunctions

DATA = pathlib.Path(os.environ.get("FROUFROU_DATA", "../shared/data")) / "audio"
OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/sms_residuals.tsv"
HOP = 128
PARTS_OF_NAMES = [
    "Knife_Sharpening",
    "Lock02_Scratch",
    "Shaking_Marbles",
    "Iron_Lid_Scraped",
    "Tube_Rolling",
    "Air_Drum_C_Dark",
    "Doorknob_Creaking",
    "Grinding_013",
    "Rupture_Marble",
    "Metallic_Ball_Rolling",
]

names = [line.split("\t")[0] for line in (DATA / "INDEX.tsv").read_text().splitlines()[1:]]
rows = ["# file\thop\tsinusoids\tresidual_db\twindow"]
for part in PARTS_OF_NAMES:
    name = next(name for name in names if part in name)
    sound, rate = soundfile.read(DATA / name, always_2d=True)
    sound = sound.mean(axis=1)[: 3 * rate]
    length = int(0.046 * rate) // 2 * 2 + 1
    found = []
    for window in ("hamming", "blackmanharris"):
        frequencies, levels, phases = sineModel.sineModelAnal(
            sound, rate, get_window(window, length), 4096, HOP, -80, 100, 0.02, 20, 0.01
        )
        residual = utilFunctions.sineSubtraction(sound, 512, HOP, frequencies, levels, phases, rate)
        left = 10 * np.log10(np.sum(residual[: len(sound)] ** 2) / np.sum(sound**2))
        found.append((left, (frequencies > 0).sum(axis=1).mean(), window))
    left, count, window = min(found)
    rows.append(f"{name}\t{HOP}\t{count:.2f}\t{left:.3f}\t{window}")
    print(rows[-1], flush=True)
OUT.write_text("\n".join(rows) + "\n")
