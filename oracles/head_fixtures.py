"""Writes the small SOFA files and the numbers that tests/head.rs reads.

Dev-only. Needs numpy, scipy and h5py from PyPI:

    pip install numpy scipy h5py
    python oracles/head_fixtures.py

The sets are a rigid sphere of radius 8.75 cm with ears at +-90 degrees, by the series of Duda & Martens (1998),
"Range dependence of the response of a spherical head model", evaluated here on its own (spherical Hankel
functions of SciPy), for sources 1.5 m away. They differ in what a SOFA file may be:

    sphere.sofa      a coarse grid of the whole sphere, float64, chunked, shuffled, deflated, old HDF5 format
    delays.sofa      the same, new HDF5 format, float32; each onset cut off and told by Data.Delay [M, R]
    cartesian.sofa   the same, positions cartesian, listener turned, receivers in the order right, left,
                     big-endian float64, contiguous
    ring.sofa        the horizon alone, in radians, fletcher32, compact scalars
    one.sofa         one direction
    shells.sofa      two distances
    other_convention.sofa, nothing.h5

and the numbers: sphere.tsv, with Brown & Duda's magnitudes and delays by their formulas, and the series' for
comparison; near.tsv, the series' levels near the head; values.tsv, what h5py reads.
"""

import pathlib

import h5py
import numpy as np
from scipy.special import spherical_jn, spherical_yn, eval_legendre

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/head"
OUT.mkdir(parents=True, exist_ok=True)
C, A = 343.0, 0.0875
RATE, N = 44100, 96


def series(frequency_hz, cosine, distance_m):
    """Pressure on the sphere over the free pressure at its centre, e^{-i omega t}; times shape."""
    k = 2 * np.pi * np.asarray(frequency_hz)[:, None] / C
    total = np.zeros((k.shape[0], len(cosine)), complex)
    for m in range(0, 90):
        h = lambda z, d=False: spherical_jn(m, z, d) + 1j * spherical_yn(m, z, d)
        with np.errstate(all="ignore"):
            ratio = h(k * distance_m) / h(k * A, True)
        ratio = np.nan_to_num(ratio)
        term = (2 * m + 1) * eval_legendre(m, cosine)[None, :] * ratio
        total += term
    # H = -r / (k a^2) e^{-ikr} sum ..., relative to the free field at the centre.
    return -distance_m / (k * A**2) * np.exp(-1j * k * distance_m) * total


def responses(cosine, distance_m, begin_s=0.0008):
    size = 512
    f = np.fft.rfftfreq(size, 1 / RATE)
    h = np.ones((len(f), len(cosine)), complex)
    h[1:] = np.conj(series(f[1:], cosine, distance_m))
    fade = np.cos(np.clip((f / (RATE / 2) - 0.8) / 0.2, 0, 1) * np.pi / 2) ** 2
    h *= (fade * np.exp(-2j * np.pi * f * begin_s))[:, None]
    return np.fft.irfft(h, axis=0)[:N].T


def directions():
    out = [(0.0, 90.0), (0.0, -90.0)]
    for elevation in (-60, -30, 0, 30, 60):
        count = 16 if abs(elevation) < 45 else 8
        out += [(azimuth, float(elevation)) for azimuth in np.arange(count) * 360.0 / count]
    return np.array(out)


def vectors(degrees):
    azimuth, elevation = np.radians(degrees).T
    return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)


def write(name, ir, positions, position_type, units, libver="earliest", kind="<f8", receivers=((0, A, 0), (0, -A, 0)),
          delay=None, view=(1, 0, 0), up=(0, 0, 1), convention="SimpleFreeFieldHRIR", storage=None, rate=RATE):
    m, r, n = ir.shape
    with h5py.File(OUT / name, "w", libver=libver) as file:
        for key, value in {"Conventions": "SOFA", "Version": "1.0", "SOFAConventions": convention,
                           "SOFAConventionsVersion": "1.0", "DataType": "FIR", "RoomType": "free field",
                           "Title": "a rigid sphere", "License": "MIT OR Apache-2.0"}.items():
            file.attrs[key] = np.bytes_(value)
        file.attrs["APIName"] = "head_fixtures.py"  # of variable length, as netCDF writes texts

        def put(name, data, attributes=(), **how):
            set = file.create_dataset(name, data=data, **how)
            for key, value in attributes:
                set.attrs[key] = np.bytes_(value)

        for dimension, size in {"M": m, "R": r, "N": n, "I": 1, "C": 3, "E": 1}.items():
            put(dimension, np.zeros(size, ">f4"), [("CLASS", "DIMENSION_SCALE")])
        put("Data.IR", ir.astype(kind), **(storage or {}))
        put("Data.SamplingRate", np.array([rate], "<f8"), [("Units", "hertz")])
        put("Data.Delay", np.zeros((1, r)) if delay is None else delay)
        put("SourcePosition", positions, [("Type", position_type), ("Units", units)])
        cartesian = [("Type", "cartesian"), ("Units", "metre")]
        put("ListenerPosition", np.zeros((1, 3)), cartesian)
        put("ListenerView", np.array([view], float), cartesian)
        put("ListenerUp", np.array([up], float))
        put("ReceiverPosition", np.array(receivers, float)[:, :, None], cartesian)
        put("EmitterPosition", np.zeros((1, 3, 1)), cartesian)


grid = directions()
unit = vectors(grid)
both = np.stack([responses(unit[:, 1], 1.5), responses(-unit[:, 1], 1.5)], 1)
both = both.astype("<f4").astype(float)
spherical = np.column_stack([grid, np.full(len(grid), 1.5)])
packed = {"chunks": (20, 1, 64), "compression": "gzip", "shuffle": True}
write("sphere.sofa", both, spherical, "spherical", "degree, degree, metre", storage=packed)

# Each onset is cut off, as far as all before is nothing.
delay = np.zeros(both.shape[:2])
cut = np.zeros((len(grid), 2, 84))
for i in range(len(grid)):
    for ear in range(2):
        audible = np.abs(both[i, ear]) > 3e-4 * np.abs(both[i, ear]).max()
        delay[i, ear] = max(np.argmax(audible) - 8, 0)
        cut[i, ear] = both[i, ear][int(delay[i, ear]):][:84]
write("delays.sofa", cut, spherical, "spherical", "degree, degree, metre", libver="latest", kind="<f4", delay=delay,
      storage={"chunks": (41, 2, 84), "compression": "gzip"})

# The listener looks along +Y; what was along x lies along y, what was left (y) along -x.
turned = np.stack([-unit[:, 1], unit[:, 0], unit[:, 2]], 1) * 1.5
write("cartesian.sofa", both[:, ::-1, :40][::2], turned[::2], "cartesian", "metre", kind=">f8", view=(0, 2, 0), up=(0, 0, 3),
      receivers=((0, -A, 0), (0, A, 0)))

ring = np.flatnonzero(grid[:, 1] == 0)
radians = np.column_stack([np.radians(grid[ring]), np.full(len(ring), 1.5)])
write("ring.sofa", both[ring], radians, "spherical", "radian, radian, metre", kind="<f4",
      storage={"chunks": (16, 2, 96), "fletcher32": True, "compression": "gzip"})
write("one.sofa", both[ring[:1]], spherical[ring[:1]], "spherical", "degree, degree, metre", kind="<f4")
near = both[ring] * 0.5
write("shells.sofa", np.concatenate([near, both[ring]]),
      np.concatenate([spherical[ring] * [1, 1, 1 / 3], spherical[ring]]), "spherical", "degree, degree, metre",
      kind="<f4", storage={"chunks": (32, 2, 96), "compression": "gzip"})
write("other_convention.sofa", both[ring[:1], :, :16], spherical[ring[:1]], "spherical", "degree, degree, metre",
      convention="MultiSpeakerBRIR", kind="<f4")
with h5py.File(OUT / "nothing.h5", "w") as file:
    file.create_dataset("numbers", data=np.arange(3))

# What h5py reads of a packed set, here and there.
with h5py.File(OUT / "sphere.sofa") as file:
    ir = file["Data.IR"][...]
places = [(i, ear, n) for i in range(0, len(ir), 7) for ear in (0, 1) for n in (20, 33, 40, 95)]
lines = ["# measurement, ear, sample, value (sphere.sofa)"]
lines += [f"{i}\t{ear}\t{n}\t{ir[i, ear, n]:.17g}" for i, ear, n in places]
(OUT / "values.tsv").write_text("\n".join(lines) + "\n")

# Brown & Duda by their formulas, and the series at a great distance for comparison.
frequencies = np.array([100, 300, 1000, 2000, 4000, 8000, 12000, 16000.0])
angles = np.arange(0, 181, 15.0)
omega0 = C / A
alpha = (1 + 0.1 / 2) + (1 - 0.1 / 2) * np.cos(angles / 150 * np.pi)
w = 2 * np.pi * frequencies[:, None]
shadow = np.abs((1 + 1j * alpha * w / (2 * omega0)) / (1 + 1j * w / (2 * omega0)))
theta = np.radians(angles)
delays = np.where(theta < np.pi / 2, -A / C * np.cos(theta), A / C * (theta - np.pi / 2))
far = np.abs(series(frequencies, np.cos(theta), 10.0))
lines = ["# angle in degrees, delay in s, then for each frequency the magnitude of Brown & Duda and of the rigid sphere",
         "# " + " ".join(f"{f:.0f}" for f in frequencies)]
for i, angle in enumerate(angles):
    pairs = [f"{shadow[k, i]:.9g}\t{far[k, i]:.9g}" for k in range(len(frequencies))]
    lines.append("\t".join([f"{angle:g}", f"{delays[i]:.12g}", *pairs]))
(OUT / "sphere.tsv").write_text("\n".join(lines) + "\n")

# Nearness: the exact sphere's level at 250 Hz, over that of a source 1.5 m away.
lines = ["# distance in m, angle in degrees, level at 250 Hz and at 4 kHz in dB relative to a source at 10 m"]
for distance in (0.15, 0.2, 0.3, 0.5, 1.0, 2.0):
    close = np.abs(series([250.0, 4000.0], np.cos(theta), distance))
    reference = np.abs(series([250.0, 4000.0], np.cos(theta), 10.0))
    for i, angle in enumerate(angles):
        db = 20 * np.log10(close[:, i] / reference[:, i])
        lines.append(f"{distance:g}\t{angle:g}\t{db[0]:.6f}\t{db[1]:.6f}")
(OUT / "near.tsv").write_text("\n".join(lines) + "\n")

difference = 20 * np.log10(shadow / far)
print("Brown & Duda less rigid sphere, dB: rows are frequencies, columns angles from 0 in 15 degrees")
print(np.round(difference, 1))
print("median %.2f dB, worst %.2f dB" % (np.median(np.abs(difference)), np.abs(difference).max()))
