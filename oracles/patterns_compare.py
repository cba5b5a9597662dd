"""Holds correlation patterns against SciPy: the same peaks, and how long each takes.

Dev-only. Needs numpy, scipy and soundfile from PyPI, the project's folder of recordings and a built example:

    pip install numpy scipy soundfile
    cargo build --release -p froufrou --no-default-features --example grain_patterns
    FROUFROU_DATA=../shared/data python oracles/patterns_compare.py [--full] [PROGRAM]

Reads recordings at 44.1 kHz, cuts them into grains by froufrou, correlates a few recordings with a few hundred of the
grains by scipy.signal.oaconvolve in single and in double precision, picks peaks by scipy.signal.find_peaks, and asks
froufrou for the same on one thread and on all. `--full` then matches 94 recordings with 5171 grains, as many as the
paper has.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import soundfile
from scipy.signal import find_peaks, oaconvolve

DATA = pathlib.Path(os.environ.get("FROUFROU_DATA", "../shared/data")) / "audio"
ROOT = pathlib.Path(__file__).resolve().parent.parent
arguments = [a for a in sys.argv[1:] if a != "--full"]
PROGRAM = arguments[0] if arguments else ROOT / "target/release/examples/grain_patterns"
RATE, MOST, LEAST, SPACING, QUIETEST = 44_100, 8, 0.3, 441, 1e-5


def recordings(count, folder, wanted_s):
    """The first recordings at the rate whose lengths come nearest to what is wanted, as raw floats."""
    rows = [line.split("\t") for line in (DATA / "INDEX.tsv").read_text().splitlines()[1:]]
    rows = [row for row in rows if row[3] == str(RATE)]
    rows.sort(key=lambda row: abs(float(row[2]) - wanted_s))
    paths = []
    for row in rows[:count]:
        sound, _ = soundfile.read(DATA / row[0], always_2d=True, dtype="float32")
        path = folder / f"{len(paths)}.f32"
        sound.mean(axis=1).astype("<f4").tofile(path)
        paths.append(path)
    return paths


def froufrou(folder, matched, grains, paths, threads=None):
    environment = dict(os.environ, **({"RAYON_NUM_THREADS": str(threads)} if threads else {}))
    command = [PROGRAM, str(RATE), folder, str(matched), str(grains), *paths]
    before = os.times()
    out = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
    after = os.times()
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    return float(out.split()[-2]), processor, out


def correlation(sound, grain, dtype):
    """The normalised cross-correlation, 0 where the sound is quiet."""
    product = oaconvolve(sound.astype(dtype), grain[::-1].astype(dtype), mode="valid")
    sums = np.concatenate([[0], np.cumsum(sound.astype(float) ** 2)])
    energy = sums[len(grain) :] - sums[: -len(grain)]
    loud = (energy >= QUIETEST * energy.max()) & (energy > 0)
    norm = np.sqrt(np.sum(grain.astype(float) ** 2))
    return np.where(loud, product / (np.sqrt(np.where(loud, energy, 1)) * norm), 0)


def peaks(values):
    """The highest peaks that no higher one is near."""
    padded = np.concatenate([[0], values, [0]])
    places = find_peaks(padded, height=LEAST)[0] - 1
    heights = values[places]
    keep = [
        i
        for i in range(len(places))
        if not np.any(
            (np.abs(places - places[i]) < SPACING)
            & ((heights > heights[i]) | ((heights == heights[i]) & (places < places[i])))
        )
    ]
    keep = sorted(keep, key=lambda i: (-heights[i], places[i]))[:MOST]
    return [(int(places[i]), float(heights[i])) for i in keep]


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    paths = recordings(94, folder, 2.6)
    seconds = sum(path.stat().st_size for path in paths) / 4 / RATE
    print(f"{len(paths)} recordings, {seconds:.0f} s")
    matched, count = 6, 200
    one, one_processor_s, _ = froufrou(folder, matched, count, paths, 1)
    first = (folder / "peaks.tsv").read_bytes()
    several, _, said = froufrou(folder, matched, count, paths)
    assert first == (folder / "peaks.tsv").read_bytes(), "the number of threads changes the peaks"
    print(said, end="")
    lengths = np.loadtxt(folder / "grains.tsv", dtype=int)
    grains = np.split(np.fromfile(folder / "grains.f32", "<f4"), np.cumsum(lengths)[:-1])
    ours = {}
    for line in first.decode().splitlines():
        recording, grain, start, value = line.split("\t")
        ours.setdefault((int(recording), int(grain)), []).append((int(start), float(value)))
    sounds = [np.fromfile(path, "<f4") for path in paths[:matched]]
    taken, processor_s = {}, {}
    for dtype in (np.float32, np.float64):
        started, started_processor = time.perf_counter(), time.process_time()
        for sound in sounds:
            for grain in grains:
                if len(grain) <= len(sound):
                    oaconvolve(sound.astype(dtype), grain[::-1].astype(dtype), mode="valid")
        taken[dtype.__name__] = time.perf_counter() - started
        processor_s[dtype.__name__] = time.process_time() - started_processor
    started = time.perf_counter()
    same = different = 0
    furthest = 0.0
    for r, sound in enumerate(sounds):
        for g, grain in enumerate(grains):
            theirs = peaks(correlation(sound, grain, float)) if len(grain) <= len(sound) else []
            mine = ours.get((r, g), [])
            if [p for p, _ in theirs] == [p for p, _ in mine]:
                same += len(theirs)
                furthest = max([furthest, *(abs(a[1] - b[1]) for a, b in zip(theirs, mine))])
            else:
                different += 1
                print("different:", r, g, theirs, mine)
    whole = time.perf_counter() - started
    print(f"{same} peaks are the same, {different} lists differ; values agree within {furthest:.1e}")
    print(f"scipy: oaconvolve alone {taken['float32']:.2f} s (32 bits), {taken['float64']:.2f} s (64 bits); with peaks {whole:.2f} s")
    print(f"froufrou with peaks: {one:.2f} s on one thread, {several:.2f} s on all")
    print(f"ratio to oaconvolve alone: {taken['float32'] / one:.1f} (32 bits, one thread), {taken['float64'] / one:.1f} (64 bits)")
    print(
        f"processor time: scipy {processor_s['float32']:.2f} s (32 bits), {processor_s['float64']:.2f} s (64 bits); "
        f"froufrou {one_processor_s:.2f} s, with peaks and the extraction of all grains"
    )
    assert different == 0
    if "--full" in sys.argv:
        took, processor, said = froufrou(folder, 94, 5171, paths)
        print(said, end="")
        print(f"wall clock {took:.1f} s, processor time with extraction {processor:.1f} s")
