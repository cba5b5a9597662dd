"""Writes spectral flux, its inflection points, Tukey windows and centroids, which the tests of grains read.

Dev-only. Needs numpy, scipy and librosa from PyPI:

    pip install numpy scipy librosa
    python oracles/grain_fixtures.py

grains.tsv, of a sound that the test makes by the same formula (44.1 kHz, 12 000 samples): rows `flux` with a frame and
the distance of normalised magnitude spectra by SciPy's ShortTimeFFT; rows `inflection` with a place in frames where the
second difference of SciPy's Gaussian of that flux (the middle frames, which no edge reaches) changes its sign; rows
`tukey` with length, taper, index and value of SciPy's window divided by its root mean square; a row `centroid` of the
samples 3000 to 5048 without a window, by librosa.
"""

import pathlib

import librosa
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import tukey

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/grains.tsv"
RATE, LENGTH, FRAME, HOP = 44_100, 12_000, 512, 128

t = np.arange(LENGTH) / RATE
sound = 0.05 * np.cos(2 * np.pi * (400 + 3000 * t) * t)
for start, hz in ((0.03, 900), (0.09, 2500), (0.17, 5200)):
    later = np.maximum(t - start, 0)
    sound += 0.5 * np.exp(-60 * later) * np.sin(2 * np.pi * hz * later)
sound = sound.astype(np.float32).astype(float)

window = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(FRAME) + 0.5) / FRAME)
transform = ShortTimeFFT(window, HOP, RATE, fft_mode="onesided")
frames = (LENGTH - 1 + HOP - 1) // HOP + 1
spectra = np.abs(transform.stft(sound, p0=0, p1=frames))
spectra /= np.linalg.norm(spectra, axis=0)
flux = np.concatenate([[0], np.linalg.norm(np.diff(spectra, axis=1), axis=0)])

DEVIATION = 0.006 * RATE / HOP
smooth = gaussian_filter1d(flux, DEVIATION, truncate=4.5)
bend = np.diff(smooth, 2)
rows = ["# what\tfigures"]
rows += [f"flux\t{m}\t{v:.9f}" for m, v in enumerate(flux)]
for i in np.nonzero(np.sign(bend[:-1]) * np.sign(bend[1:]) < 0)[0]:
    m = i + 1
    if 10 <= m < frames - 10:
        rows.append(f"inflection\t{m + bend[i] / (bend[i] - bend[i + 1]):.6f}\t{abs(smooth[m + 1] - smooth[m]):.9f}")
for length, taper in ((300, 0.02), (1000, 0.02), (64, 0.5), (33, 1.0)):
    plain = tukey(length, taper)
    plain /= np.sqrt(np.mean(plain**2))
    for index in range(0, length, 1 if length < 100 else 1 + length // 40):
        rows.append(f"tukey\t{length}\t{taper}\t{index}\t{plain[index]:.12f}")
centroid = librosa.feature.spectral_centroid(
    y=sound[3000:5048], sr=RATE, n_fft=2048, hop_length=2048, window=np.ones(2048), center=False
)
rows.append(f"centroid\t{centroid[0, 0]:.6f}")
OUT.write_text("\n".join(rows) + "\n")
print(len(rows), "rows")
