"""Writes mel cepstra by librosa, Gaussian smoothing and a Butterworth high-pass by SciPy, which the tests of units read.

Dev-only. Needs numpy, scipy and librosa from PyPI:

    pip install numpy scipy librosa
    python oracles/mfcc_golden.py

units_features.tsv, a line a case: its name, then numbers. `plain`, `corduroy`, `many` and `decibels` are features row by
row of a sound that the tests make by the same formula: librosa.feature.mfcc of log-power mel spectra (mel scale not
HTK's, norm "slaney", power 2, DCT type II, norm "ortho"), where the logarithm is NumPy's natural one or librosa's
power_to_db without a floor under the loudest. `smooth_in` and `smooth_out` are three dimensions of 120 units before and
after scipy.ndimage.gaussian_filter1d. `high_pass_in` and `high_pass_out` are a sound before and after
scipy.signal.sosfilt of butter(5, 100 Hz) at 96 kHz.
"""

import pathlib

import librosa
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfilt

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/units_features.tsv"


def sound(rate, samples):
    t = np.arange(samples) / rate
    chirp = np.sin(2 * np.pi * (300 + 20_000 * t) * t)
    click = np.exp(-400 * (t % 0.03)) * np.sin(2 * np.pi * 3100 * t)
    return (0.2 * chirp * np.maximum(1 - t * 6, 0) + 0.5 * click).astype(np.float32).astype(float)


def features(rate, unit_s, window_s=None, window="hann", bands=3, kept=3, low=0.0, high=None, decibels=False):
    unit = int(np.floor(unit_s * rate + 0.5))
    length = int(np.floor((window_s or unit_s) * rate + 0.5))
    size = 1 << (length - 1).bit_length()
    y = sound(rate, rate // 8)
    # The window's middle is the unit's; librosa puts it into the middle of the frame.
    before = -((unit - length) // 2) + (size - length) // 2
    y = np.concatenate([np.zeros(before), y, np.zeros(size)])
    spectrum = librosa.stft(y, n_fft=size, hop_length=unit, win_length=length, window=window, center=False)
    mel = librosa.feature.melspectrogram(
        S=np.abs(spectrum) ** 2, sr=rate, n_fft=size, n_mels=bands, fmin=low, fmax=high, htk=False, norm="slaney", dtype=float
    )
    level = librosa.power_to_db(mel, amin=1e-10, top_db=None) if decibels else np.log(np.maximum(mel, 1e-10))
    return librosa.feature.mfcc(S=level, n_mfcc=kept, dct_type=2, norm="ortho").T


lines = []


def line(name, values, digits=7):
    lines.append("\t".join([name, *(f"{v:.{digits}g}" for v in np.ravel(values))]))


line("plain", features(96_000, 0.0042)[:25])
line("corduroy", features(96_000, 0.0167)[:7])
line("many", features(44_100, 0.01, window_s=0.02, bands=26, kept=13)[:12])
line(
    "decibels",
    features(48_000, 0.0042, window="boxcar", bands=8, kept=5, low=200.0, high=16_000.0, decibels=True)[:25],
)
random = np.random.default_rng(5)
plain = np.cumsum(random.normal(size=(120, 3)), axis=0).astype(np.float32).astype(float)
smooth = np.stack(
    [gaussian_filter1d(plain[:, d], w / 4, mode="nearest", truncate=4) for d, w in enumerate((20, 50, 10))], axis=1
)
line("smooth_in", plain, 9)
line("smooth_out", smooth, 9)
noise = random.normal(size=300).astype(np.float32).astype(float)
noise[100:] *= 0.1
line("high_pass_in", noise, 9)
line("high_pass_out", sosfilt(butter(5, 100, "highpass", fs=96_000, output="sos"), noise), 12)
OUT.write_text("\n".join(lines) + "\n")
print(OUT.stat().st_size, "bytes")
