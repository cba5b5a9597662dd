"""Holds features of units against librosa: the same numbers, and how long each takes.

Dev-only. Needs numpy, scipy and librosa from PyPI and a built example:

    pip install numpy scipy librosa
    cargo build --release -p froufrou --no-default-features --example unit_features
    python oracles/cloth_features_speed.py [PROGRAM]

Three minutes and 45 seconds at 96 kHz, as long as the paper's database of cotton, of noise that swells and fades.
librosa.stft and librosa.feature work in single precision, as they do on what soundfile reads; the best of three times
counts for both.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import librosa
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else ROOT / "target/release/examples/unit_features"
RATE, SECONDS, UNIT, SIZE = 96_000, 225, 403, 512

random = np.random.default_rng(3)
t = np.arange(RATE * SECONDS) / RATE
sound = (random.normal(size=len(t)) * np.exp(-4 + 3 * np.sin(7 * t))).astype(np.float32)
before = (SIZE - UNIT) // 2
padded = np.concatenate([np.zeros(before, np.float32), sound, np.zeros(SIZE, np.float32)])


def features(y):
    spectrum = librosa.stft(y, n_fft=SIZE, hop_length=UNIT, win_length=UNIT, center=False)
    mel = librosa.feature.melspectrogram(S=np.abs(spectrum) ** 2, sr=RATE, n_fft=SIZE, n_mels=3)
    return librosa.feature.mfcc(S=np.log(np.maximum(mel, 1e-10)), n_mfcc=3).T


def best(function):
    times = []
    for _ in range(3):
        started = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - started)
    return min(times), result


theirs_s, theirs = best(lambda: features(padded))
with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    sound.astype("<f4").tofile(folder / "sound.f32")
    run = {}
    for threads in (1, os.cpu_count()):
        environment = dict(os.environ, RAYON_NUM_THREADS=str(threads))
        command = [PROGRAM, str(RATE), folder / "sound.f32", folder / "features.f32"]
        out = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
        run[threads] = float(out)
    ours = np.fromfile(folder / "features.f32", "<f4").reshape(-1, 3)
units = min(len(ours), len(theirs))
difference = np.abs(ours[:units] - theirs[:units]).max()
print(f"{units} units, the largest difference is {difference:.1e}")
print(f"librosa {theirs_s:.2f} s; froufrou " + ", ".join(f"{s:.2f} s on {n} threads" for n, s in run.items()))
print(f"ratio {theirs_s / min(run.values()):.1f} on all threads, {theirs_s / run[1]:.1f} on one")
# Both round; single precision shows where little is left of large sums.
assert difference < 1e-3
assert theirs_s > 3 * min(run.values())
