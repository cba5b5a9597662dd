"""Reads what froufrou writes with programs of others: FLAC against the WAV of the same render, labels, projects.

Needs: pip install numpy soundfile rpp; ffmpeg, ffprobe and flac on the path; `cargo build --release`.

    python oracles/output_compare.py
"""

import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import rpp
import soundfile as sf

ROOT = Path(__file__).resolve().parent.parent
FROUFROU = ROOT / "target/release/froufrou"


def render(scene, out, *options):
    command = [FROUFROU, "render", ROOT / "examples" / scene / "scene.toml", "-o", out, "--to", "3", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def check(what, good):
    print("ok  " if good else "FAIL", what)
    if not good:
        raise SystemExit(1)


def flac(folder, scene, bits, rate):
    wav, packed = folder / "x.wav", folder / "x.flac"
    for path in (wav, packed):
        render(scene, path, "--format", bits, "--rate", rate)
    plain, plain_rate = sf.read(wav, dtype="int32")
    read, read_rate = sf.read(packed, dtype="int32")
    name = f"{scene}, {bits} bits, {rate} Hz, {packed.stat().st_size / wav.stat().st_size:.2f} of WAV"
    check(f"soundfile: {name}", plain_rate == read_rate == int(rate) and np.array_equal(plain, read))
    decoded = subprocess.run(
        ["ffmpeg", "-v", "error", "-i", packed, "-f", "s32le", "-c:a", "pcm_s32le", "-"], capture_output=True, check=True
    )
    check(f"ffmpeg: {name}", np.array_equal(np.frombuffer(decoded.stdout, "<i4"), plain.ravel()) and not decoded.stderr)
    check(f"flac -t: {name}", subprocess.run(["flac", "-t", "-s", packed]).returncode == 0)


def labels(folder):
    for ending in ("wav", "flac"):
        path = folder / f"y.{ending}"
        render("tower", path, "--from", "1", "--description", "a tower", "--time-reference", "10:00:00:12@25")
        probe = subprocess.run(
            ["ffprobe", "-v", "error", "-of", "json", "-show_format", path], capture_output=True, check=True
        )
        tags = {k.lower(): v for k, v in json.loads(probe.stdout)["format"]["tags"].items()}
        reference = tags.get("time_reference", tags.get("timereference"))
        check(f"ffprobe: labels of {ending}", tags["comment"] == "a tower" and reference == str((36_001 * 25 + 12) * 1920))


def project(folder):
    render("tower", folder / "z.wav", "--reaper", folder / "z.rpp")
    with open(folder / "z.rpp") as file:
        tree = rpp.load(file)
    files = [track.find("ITEM").find("SOURCE").find("FILE")[1] for track in tree.findall("TRACK")]
    check("rpp: every file of the project is there", len(files) > 1 and all((folder / file).is_file() for file in files))
    markers = [row for row in tree if isinstance(row, list) and row[0] == "MARKER"]
    check(f"rpp: {len(markers)} markers in order", [float(m[2]) for m in markers] == sorted(float(m[2]) for m in markers))


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for scene in ("ambulance", "tower"):
            for bits, rate in (("16", "44100"), ("24", "48000"), ("24", "192000")):
                flac(folder, scene, bits, rate)
        labels(folder)
        project(folder)


if __name__ == "__main__":
    main()
