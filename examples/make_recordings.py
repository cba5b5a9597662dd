"""Makes every recording of the example scenes. All of them are synthetic: nothing was recorded.

Dev-only; the recordings are in the repository. Deterministic: the same files every time.

    pip install numpy scipy soundfile
    python examples/make_recordings.py            # writes the files
    python examples/make_recordings.py --check    # and tells their level, decay and spectrum

A hit is modal synthesis (`strike`): what is struck is a set of modes, each a decaying sine. A mode is
excited as much as its shape is large where the blow falls, so that no two strike positions sound alike.
The blow is a half sine as long as the bodies stay in contact: the harder they are the shorter it is,
and the brighter the sound (modes far above 1 / contact time are hardly excited). A short burst of noise
with the same contact time stands for the roughness of the surfaces.

Loops are made in the frequency domain or of whole periods, so they join without a seam and scenes may
play them with `loop = "exact"`.
"""

import pathlib
import sys

import numpy as np
import soundfile as sf
from scipy import signal

HERE = pathlib.Path(__file__).parent
RATE = 48_000
PEAK = 10 ** (-3 / 20)


# ---------------------------------------------------------------------------------------------
# Hits


def strike(modes, contact_s, length_s, noise=0.0, rng=None):
    """A blow on something with modes, rows of (frequency in Hz, decay time constant in s, weight).

    A unit impulse gives all modes a velocity, and so an acceleration that goes with their frequency, and
    pressure goes with acceleration: sum of w f sin(2 pi f t) exp(-t / tau), convolved with the half sine
    of the contact.
    """
    n = int(length_s * RATE)
    t = np.arange(n) / RATE
    ring = np.zeros(n)
    for f, tau, w in modes:
        if f < 0.42 * RATE:
            ring += w * (f / 1000) * np.sin(2 * np.pi * f * t) * np.exp(-t / tau)
    m = max(4, int(round(contact_s * RATE)))
    pulse = np.sin(np.pi * np.arange(m) / m)
    pulse /= pulse.sum()
    out = signal.fftconvolve(ring, pulse)[:n]
    if noise > 0:
        # Roughness: noise as short as the contact, and no brighter than it.
        burst = rng.standard_normal(n) * np.exp(-t / (1.5 * contact_s)) * (1 - np.exp(-t / (0.2 * contact_s)))
        burst = signal.fftconvolve(burst, pulse)[:n]
        out += noise * burst * np.abs(out).max() / np.abs(burst).max()
    return out


def trimmed(x):
    """No DC or rumble below hearing, and a fade at the end from wherever it has got to."""
    sos = signal.butter(2, 25, "highpass", fs=RATE, output="sos")
    x = signal.sosfilt(sos, x)
    # It ends where what is left is 75 dB below the peak.
    loud = np.nonzero(np.abs(x) > np.abs(x).max() * 10 ** (-75 / 20))[0]
    x = x[: min(len(x), loud[-1] + 480)]
    fade = min(len(x) // 4, int(0.04 * RATE))
    x[-fade:] *= np.cos(np.linspace(0, np.pi / 2, fade)) ** 2
    # The fade leaves a mean of its own; take it away with the shape of the sound's envelope.
    envelope = np.hanning(2 * len(x))[len(x) :] * (1 - np.exp(-np.arange(len(x)) / 48))
    return x - x.mean() * envelope / envelope.mean()


def levelled(hits):
    """Variations as loud as each other (by their energy), the one with the highest peak at -3 dBFS."""
    hits = [trimmed(x) for x in hits]
    hits = [x / np.sqrt(np.sum(x**2)) for x in hits]
    top = max(np.abs(x).max() for x in hits)
    return [x * PEAK / top for x in hits]


def plate_modes(a, b, thickness, youngs, density, loss, at, most=40, jitter=0.0, rng=None):
    """A rectangular plate, simply supported: f = pi/2 sqrt(D / rho h) (m^2/a^2 + n^2/b^2).

    `at` is where it is struck, as fractions of its sides; `loss` the loss factor: tau = 1 / (pi f loss).
    """
    stiffness = thickness * np.sqrt(youngs / (12 * density * (1 - 0.3**2)))
    modes = []
    for m in range(1, 9):
        for n in range(1, 9):
            f = np.pi / 2 * stiffness * ((m / a) ** 2 + (n / b) ** 2)
            f *= 1 + (jitter * rng.standard_normal() if rng is not None else 0)
            w = np.sin(m * np.pi * at[0]) * np.sin(n * np.pi * at[1])
            modes.append((f, 1 / (np.pi * f * loss), w))
    return sorted(modes)[:most]


def rubber(index):
    """An air-filled rubber ball, 12 cm across, that lands on a hard floor.

    Soft, so in contact for about 2 ms: a thump. The skin rings low and is damped by the rubber; the air
    inside has the modes of a sphere, j_l'(ka) = 0: ka = 2.082, 3.342, 4.493, which give the ball its ping.
    """
    rng = np.random.default_rng(100 + index)
    radius = 0.06
    air = [(ka * 343 / (2 * np.pi * radius), 0.035 / k, w) for k, (ka, w) in enumerate([(2.082, 0.30), (3.342, 0.13), (4.493, 0.06)], 1)]
    skin = [(f, 0.04 * (130 / f) ** 0.6, w) for f, w in [(128, 1.0), (196, 0.9), (305, 0.8), (462, 0.6), (690, 0.45), (1040, 0.3)]]
    modes = [(f * (1 + 0.025 * rng.standard_normal()), tau, w * rng.uniform(0.5, 1.2) * 2 ** (f / 1500)) for f, tau, w in skin + air]
    return strike(modes, rng.uniform(0.0017, 0.0022), 0.45, noise=0.10, rng=rng)


def wood(index):
    """A closed box of 8 mm softwood, 20 cm along each edge, knocked by something hard (contact 0.7 ms).

    Three pairs of faces, each a little unlike the others, and the air inside (343 / 2 L).
    """
    rng = np.random.default_rng(200 + index)
    modes = []
    for face, thickness in enumerate((0.0080, 0.0086, 0.0075)):
        at = rng.uniform(0.12, 0.45, 2)
        weight = 1.0 if face == 0 else 0.35
        for f, tau, w in plate_modes(0.2, 0.2, thickness, 9e9, 520, 0.022, at, 24, 0.012, rng):
            modes.append((f * 0.62, tau * 1.3, w * weight))  # the edges give way: lower than supported
    modes.append((343 / 0.4, 0.018, 0.5))
    modes.append((rng.uniform(150, 175), 0.022, 0.9))  # the whole box on what it stands on
    return strike(modes, rng.uniform(0.0006, 0.0008), 0.4, noise=0.12, rng=rng)


def stone(index):
    """A brick, 20 x 10 x 10 cm, struck by another (contact 0.25 ms).

    Bending of a free bar, f = (h / 2 pi sqrt(12) L^2) sqrt(E / rho) x 22.4, 61.7, 121, far less for so thick
    a bar (Timoshenko): here about 0.55, 0.42 and 0.34 of it. The stone damps it within hundredths of a
    second; below it lies the thud of the pile.
    """
    rng = np.random.default_rng(300 + index)
    speed = np.sqrt(14e9 / 2000)
    modes = []
    for width, weight in ((0.1, 1.0), (0.096, 0.7)):
        for eigen, thick, n in ((22.37, 0.55, 1), (61.67, 0.42, 2), (120.9, 0.34, 3)):
            f = eigen * thick * width * speed / (2 * np.pi * np.sqrt(12) * 0.2**2)
            x = rng.uniform(0.02, 0.48)
            # Free bar: largest at the ends, with as many nodes as its order and one.
            w = np.cos((n + 0.5) * np.pi * x) * weight
            modes.append((f * (1 + 0.02 * rng.standard_normal()), 1 / (np.pi * f * 0.006), w))
    modes.append((speed / 0.4 * 0.97, 0.006, 0.4 * rng.uniform(0.4, 1)))  # along its length
    for f in (140, 230, 390, 640, 980, 1500):
        modes.append((f * rng.uniform(0.93, 1.07), 0.022 * (230 / f) ** 0.5, 0.7 * rng.uniform(0.4, 1)))
    return strike(modes, rng.uniform(0.0002, 0.00028), 0.3, noise=0.35, rng=rng)


def coin(index):
    """A thick steel coin, 6 cm across, 4 mm thick, on stone (contact 0.12 ms).

    Modes of a free disc: f = lambda^2 / (2 pi a^2) sqrt(D / rho h), lambda^2 = 5.25, 9.08, 12.2, 20.5, 21.6,
    33.1 for 2, 0, 3, 1, 4, 5 nodal diameters. What is embossed on it splits those with diameters into
    pairs some hertz apart, which beat. Where it touches it is damped, each time elsewhere.
    """
    rng = np.random.default_rng(400 + index)
    stiffness = 0.004 * np.sqrt(200e9 / (12 * 7800 * (1 - 0.3**2)))
    modes = []
    touch = rng.uniform(0, np.pi)
    for eigen, diameters in ((5.253, 2), (9.084, 0), (12.23, 3), (20.52, 1), (21.6, 4)):
        f = 0.82 * eigen * stiffness / (2 * np.pi * 0.03**2)  # thick: lower than a thin plate
        tau = 0.11 * (4500 / f) ** 0.8 * rng.uniform(0.6, 1.1)
        w = rng.uniform(0.6, 1.0) * (4500 / f) ** 1.3
        for split, phase in ((1.0, 0.0), (1.0 + 0.0035 * diameters**0.5, np.pi / 2)):
            share = np.cos(diameters * touch - phase) if diameters else 0.7
            modes.append((f * split, tau, w * share))
    for f in (420, 910, 1700):
        modes.append((f * rng.uniform(0.9, 1.1), 0.006, 0.3))
    return strike(modes, rng.uniform(0.0001, 0.00014), 0.42, noise=0.25, rng=rng)


def floor(index):
    """A solid ball of 2 kg that drops on boards (contact 1.6 ms): planks 2.2 cm thick on joists 60 cm apart."""
    rng = np.random.default_rng(500 + index)
    modes = [(f, min(tau, 0.05), w) for f, tau, w in plate_modes(0.6, 1.4, 0.022, 10e9, 500, 0.055, rng.uniform(0.2, 0.48, 2), 36, 0.02, rng)]
    modes += [(rng.uniform(58, 66), 0.05, 1.2), (rng.uniform(96, 108), 0.035, 0.8)]
    return strike(modes, rng.uniform(0.0013, 0.0018), 0.5, noise=0.15, rng=rng)


# ---------------------------------------------------------------------------------------------
# Loops


def looped_noise(length_s, level_db, seed):
    """Noise that joins its own beginning: random phases at the whole harmonics of its length.

    `level_db(f)` is its spectrum in dB per hertz.
    """
    n = int(length_s * RATE)
    f = np.fft.rfftfreq(n, 1 / RATE)
    rng = np.random.default_rng(seed)
    spectrum = 10 ** (level_db(np.maximum(f, 1)) / 20) * np.exp(2j * np.pi * rng.random(len(f)))
    spectrum[f < 20] = 0
    return np.fft.irfft(spectrum, n)


def resonances(f, peaks):
    """Bumps in a spectrum, in dB: rows of (frequency, width, height in dB)."""
    return sum(height / (1 + ((f - f0) / width) ** 2) for f0, width, height in peaks)


def loop_level(x, peak_db=-3.0):
    x = x - x.mean()
    return x * 10 ** (peak_db / 20) / np.abs(x).max()


def rumble():
    """A hard ball that rolls on boards, twice round in the loop: low noise that falls by 7 dB an octave above 120 Hz,
    some resonances of the boards, and louder once a turn, where the ball is less than round."""
    length = 1.5
    x = looped_noise(
        length,
        lambda f: -23 * np.log10(np.maximum(f, 120) / 120) - 12 * np.maximum(0, np.log2(60 / f)) + resonances(f, [(105, 15, 9), (190, 25, 7), (340, 40, 6), (620, 80, 6), (1150, 160, 5)])
        - 60 * np.maximum(0, np.log2(f / 3000)),
        610,
    )
    t = np.arange(len(x)) / RATE
    turns = 2 * np.pi * t * 2 / length
    return loop_level(x * (1 + 0.28 * np.cos(turns) + 0.14 * np.cos(3 * turns + 1) + 0.08 * np.cos(8 * turns + 2)))


def siren():
    """A two-tone horn as on European ambulances: 440 Hz and a fourth above it, 0.75 s each.

    The pitch glides within 12 ms. Its mean over the loop is a whole number of cycles (330 + 440), so the
    phase runs on over the seam. Ten harmonics that fall as a reed horn's do.
    """
    n = int(1.5 * RATE)
    f = np.where(np.arange(n) < n // 2, 440.0, 440 * 4 / 3)
    window = np.hanning(int(0.012 * RATE) | 1)
    kernel = np.zeros(n)
    kernel[: len(window)] = window / window.sum()
    kernel = np.roll(kernel, -(len(window) // 2))
    f = np.fft.irfft(np.fft.rfft(f) * np.fft.rfft(kernel), n)
    phase = 2 * np.pi * np.cumsum(f) / RATE
    x = sum(a * np.sin(k * phase + 0.35 * k * k) for k, a in enumerate((1, 0.75, 0.6, 0.42, 0.30, 0.2, 0.13, 0.085, 0.055, 0.035), 1))
    return loop_level(x)


def engine():
    """A diesel under load, quietly: four cylinders at 2400 turns a minute fire 80 times a second. Eight
    turns of the crankshaft to the loop, no two firings quite alike, and some noise of the tyres."""
    length = 1.0
    n = int(length * RATE)
    rng = np.random.default_rng(630)
    clicks = np.zeros(n)
    for k in range(80):
        clicks[int((k + 0.05 * rng.standard_normal() * (k > 0)) * n / 80) % n] += (1.0, 0.86, 0.94, 0.9)[k % 4] * rng.uniform(0.85, 1.1)
    thump = strike([(78, 0.012, 1), (160, 0.01, 0.7), (240, 0.008, 0.5), (410, 0.006, 0.35), (870, 0.003, 0.2)], 0.0008, 0.2)
    thump = np.pad(thump, (0, n - len(thump)))
    x = np.fft.irfft(np.fft.rfft(clicks) * np.fft.rfft(thump), n)
    tyres = looped_noise(length, lambda f: -14 * np.abs(np.log2(f / 850)) * 0.5 - 40 * np.maximum(0, np.log2(f / 3500)), 631)
    return loop_level(x / np.std(x) + 0.35 * tyres / np.std(tyres))


# ---------------------------------------------------------------------------------------------
# What goes on: bodies that roll and slide, for corpora of grains


def going_on(modes, blows, length_s):
    """What rings under many small blows: `blows` is their force over time, one value a sample."""
    n = int(length_s * RATE)
    ring = strike(modes, 0.0003, 0.25)
    x = signal.fftconvolve(blows, ring)[:n]
    # Its ends are no part of it: the grains that are cut there fade anyway.
    x -= x.mean()
    return x * PEAK / np.abs(x).max()


def swell(rng, n, rate_hz, depth):
    """A factor that wanders about 1, as fast as so many times a second."""
    sos = signal.butter(2, rate_hz, "lowpass", fs=RATE, output="sos")
    x = signal.sosfilt(sos, rng.standard_normal(n + RATE))[RATE:]
    return np.exp(depth * x / x.std())


def rolled(index):
    """A wooden ball that rolls on boards: some three hundred small blows a second, of very unequal strength, on the
    modes of both, and the hiss of the surfaces; now louder, now softer as the boards have it."""
    rng = np.random.default_rng(700 + index)
    length, n = 2.0, int(2.0 * RATE)
    modes = [(f, min(tau, 0.03), w) for f, tau, w in plate_modes(0.6, 1.4, 0.022, 10e9, 500, 0.06, rng.uniform(0.2, 0.48, 2), 24, 0.02, rng)]
    modes += [(f * rng.uniform(0.97, 1.03), 0.008, w) for f, w in ((760, 0.5), (1180, 0.4), (1730, 0.3), (2600, 0.15))]
    blows = np.zeros(n)
    at = rng.uniform(0, n, int(300 * length)).astype(int)
    np.add.at(blows, at, rng.lognormal(0, 1.1, len(at)))
    blows += 0.02 * rng.standard_normal(n)
    return going_on(modes, blows * swell(rng, n, 4, 0.3), length)


def scraped(index):
    """A wooden box that slides on boards: rough noise that catches and lets go, on the modes of the box."""
    rng = np.random.default_rng(720 + index)
    length, n = 2.0, int(2.0 * RATE)
    modes = [(f * 0.62, min(tau, 0.01), w) for f, tau, w in plate_modes(0.2, 0.2, 0.008, 9e9, 520, 0.03, rng.uniform(0.12, 0.45, 2), 24, 0.012, rng)]
    modes += [(rng.uniform(2800, 3300), 0.002, 0.4), (rng.uniform(4300, 5200), 0.0015, 0.3)]
    blows = rng.standard_normal(n) * swell(rng, n, 45, 0.5) * swell(rng, n, 5, 0.25)
    sos = signal.butter(1, 900, "highpass", fs=RATE, output="sos")
    return going_on(modes, signal.sosfilt(sos, blows) + 0.15 * blows, length)


def spun(index):
    """A thick steel coin that wobbles on stone: a hundred and fifty blows a second about its rim."""
    rng = np.random.default_rng(740 + index)
    length, n = 1.5, int(1.5 * RATE)
    stiffness = 0.004 * np.sqrt(200e9 / (12 * 7800 * (1 - 0.3**2)))
    modes = [(0.82 * eigen * stiffness / (2 * np.pi * 0.03**2) * rng.uniform(0.99, 1.01), 0.03, w) for eigen, w in ((5.253, 1.0), (9.084, 0.4), (12.23, 0.5), (20.52, 0.2))]
    modes += [(f * rng.uniform(0.9, 1.1), 0.006, 0.3) for f in (420, 910, 1700)]
    blows = np.zeros(n)
    at = rng.uniform(0, n, int(150 * length)).astype(int)
    np.add.at(blows, at, rng.lognormal(0, 0.8, len(at)))
    blows += 0.01 * rng.standard_normal(n)
    return going_on(modes, blows * swell(rng, n, 6, 0.25), length)


# ---------------------------------------------------------------------------------------------
# Which scene has which


HITS = {"rubber": (rubber, 6), "wood": (wood, 6), "stone": (stone, 6), "coin": (coin, 6), "floor": (floor, 5)}
LOOPS = {"rumble": rumble, "siren": siren, "engine": engine}
LASTING = {"rolled": (rolled, 2), "scraped": (scraped, 2), "spun": (spun, 2)}
SCENES = {
    "bounce": ["rubber", "wood"],
    "ambulance": ["siren", "engine"],
    "demo": ["siren", "rubber", "wood", "coin"],
}
# Of corpora, by what the bodies do: the folders that `froufrou grains build` takes labels from.
CORPORA = {
    "collisions": {"stone/hit": ["stone"], "wood/hit": ["wood"], "wood/roll": ["rolled"], "wood/slide": ["scraped"], "coin/hit": ["coin"], "coin/roll": ["spun"]},
    "tower": {"wood/hit": ["wood"], "wood/roll": ["rolled"], "wood/slide": ["scraped"], "floor/hit": ["floor"]},
}


def main():
    made = {}
    for name, (make, count) in HITS.items():
        made[name] = [(f"{name}{k + 1}.flac", x) for k, x in enumerate(levelled([make(k) for k in range(count)]))]
    for name, make in LOOPS.items():
        made[name] = [(f"{name}.flac", make())]
    for name, (make, count) in LASTING.items():
        made[name] = [(f"{name}{k + 1}.flac", make(k)) for k in range(count)]
    total = 0
    for scene in SCENES | CORPORA:
        folder = HERE / scene / "recordings"
        size = write(folder, SCENES.get(scene, []), made)
        for action, names in CORPORA.get(scene, {}).items():
            size += write(folder / action, names, made)
        total += size
        print(f"{scene:<12} {size / 1000:6.0f} kB")
    print(f"{'together':<12} {total / 1000:6.0f} kB")
    if "--check" in sys.argv[1:]:
        check(made)


def write(folder, names, made):
    """Writes recordings in the place of those that are there; gives their size in bytes."""
    if not names:
        return 0
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.flac"):
        old.unlink()
    for name in names:
        for file, x in made[name]:
            sf.write(folder / file, np.round(x * 32767).astype(np.int16), RATE, format="FLAC", subtype="PCM_16", compression_level=1.0)
    return sum(file.stat().st_size for file in folder.glob("*.flac"))


def check(made):
    """Levels, decay, spectrum and seams of everything that was made."""
    print("file            length   peak    rms     DC   centroid   T60    end or seam")
    for name, files in made.items():
        for file, x in files:
            power = np.abs(np.fft.rfft(x)) ** 2
            f = np.fft.rfftfreq(len(x), 1 / RATE)
            centroid = np.sum(f * power) / np.sum(power)
            rest = np.cumsum(x[::-1] ** 2)[::-1]
            rest_db = 10 * np.log10(rest / rest[0] + 1e-15)
            t5, t25 = np.argmax(rest_db < -5) / RATE, np.argmax(rest_db < -25) / RATE
            decay = f"{3 * (t25 - t5):5.2f} s" if name in HITS else "   -   "
            if name in HITS:
                end = f"{20 * np.log10(np.abs(x[-24:]).max() / np.abs(x).max() + 1e-9):6.1f} dB"
            else:
                # The step over the seam against the largest step anywhere.
                end = f"{np.abs(x[0] - x[-1]) / np.abs(np.diff(x)).max():6.2f} of the largest step"
            peak, rms = 20 * np.log10(np.abs(x).max()), 10 * np.log10(np.mean(x**2))
            print(f"{file:<14} {len(x) / RATE:6.3f} s {peak:6.1f} {rms:6.1f} {20 * np.log10(abs(x.mean()) + 1e-9):6.0f} {centroid:8.0f} Hz {decay}  {end}")


if __name__ == "__main__":
    main()
