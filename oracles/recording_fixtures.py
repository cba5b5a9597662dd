"""Writes the audio files that the tests of recording.rs read, and the loudness cases of meter.rs.

Dev-only. Needs numpy, soundfile and pyloudnorm from PyPI; ffmpeg, lame, sox, flac and vorbis-tools
(oggenc) from Debian:

    pip install numpy soundfile pyloudnorm
    apt-get install ffmpeg lame sox flac vorbis-tools
    python oracles/recording_fixtures.py

Every file holds the same known sound: channel c (from 0) of a file at rate r is, at frame i,

    0.4 sin(2 pi f i / r) + 0.2 sin(2 pi 1.7 f i / r + c)    with f = 250 + 70 c

so that a channel in the wrong place, a frame too many and a sample too large all show.
"""

import pathlib
import re
import subprocess
import tempfile

import numpy as np
import pyloudnorm
import soundfile as sf

OUT = pathlib.Path(__file__).parent.parent / "crates/froufrou/tests/fixtures/audio"


def signal(rate_hz, channels, frames):
    i = np.arange(frames)[:, None]
    c = np.arange(channels)[None, :]
    f = 250.0 + 70.0 * c
    turn = 2 * np.pi * i / rate_hz
    return 0.4 * np.sin(f * turn) + 0.2 * np.sin(1.7 * f * turn + c)


def quantised(samples, subtype):
    """The samples as integers of the subtype, at the top of what soundfile takes: exact to half a step
    (soundfile's own conversion scales by one step less)."""
    bits = {"PCM_U8": 8, "PCM_24": 24, "PCM_32": 32, "FLOAT": 0, "DOUBLE": 0}.get(subtype, 16)
    if bits == 0:
        return samples
    kind, width = (np.int16, 16) if bits <= 16 else (np.int32, 32)
    return (np.round(samples * 2.0 ** (bits - 1)).astype(np.int64) << (width - bits)).astype(kind)


def run(*command):
    subprocess.run([str(part) for part in command], check=True, capture_output=True)


def plain(name, rate_hz, channels, frames, container, subtype, endian=None):
    sound = quantised(signal(rate_hz, channels, frames), subtype)
    sf.write(OUT / name, sound, rate_hz, subtype, endian, container)
    # Files of floats hold the time of writing: not here, so that the script repeats itself.
    data = bytearray((OUT / name).read_bytes())
    if (peak := data.find(b"PEAK")) >= 0:
        data[peak + 12 : peak + 16] = bytes(4)
        (OUT / name).write_bytes(data)


def loud_signal(rate_hz, channels):
    """8 s of two swelling tones in each channel, the closed form that the test of the meter repeats."""
    t = np.arange(8 * rate_hz)[:, None] / rate_hz
    c = np.arange(channels)[None, :]
    swell = 0.3 * (1 + 0.9 * np.sin(2 * np.pi * 0.7 * t + c))
    low = 0.5 * np.sin(2 * np.pi * (180 + 130 * c) * t)
    return swell * (low + 0.3 * np.sin(2 * np.pi * (2900 + 410 * c) * t + 0.5))


def loudness():
    """Integrated loudness by pyloudnorm and by ffmpeg, true peak by ffmpeg."""
    lines = ["rate_hz\tchannels\tpyloudnorm_lufs\tffmpeg_lufs\tffmpeg_true_peak_dbtp"]
    with tempfile.TemporaryDirectory() as folder:
        for rate_hz, channels in [(48000, 1), (48000, 2), (44100, 2), (96000, 2), (48000, 5), (8000, 1)]:
            sound = loud_signal(rate_hz, channels)
            path = pathlib.Path(folder) / "loud.wav"
            sf.write(path, sound, rate_hz, "FLOAT")
            layout = {1: "mono", 2: "stereo", 5: "5.0"}[channels]
            command = ["ffmpeg", "-hide_banner", "-nostats", "-i", path,
                       "-af", f"aformat=channel_layouts={layout},ebur128=peak=true", "-f", "null", "-"]
            report = subprocess.run([str(p) for p in command], check=True, capture_output=True, text=True).stderr
            summary = report[report.rindex("Summary:"):]
            lufs = re.search(r"I: +(-?[0-9.]+) LUFS", summary).group(1)
            peak = re.search(r"Peak: +(-?[0-9.]+) dBFS", summary).group(1)
            by_pyloudnorm = pyloudnorm.Meter(rate_hz).integrated_loudness(sound)
            lines.append(f"{rate_hz}\t{channels}\t{by_pyloudnorm:.3f}\t{lufs}\t{peak}")
    (OUT.parent / "loudness.tsv").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    # WAV in every width, at several rates and channel counts; more than two channels and more than 16
    # bits in the extensible header.
    plain("mono_8000_u8.wav", 8000, 1, 801, "WAV", "PCM_U8")
    plain("stereo_44100_s16.wav", 44100, 2, 1103, "WAV", "PCM_16")
    plain("six_48000_s16_extensible.wav", 48000, 6, 501, "WAVEX", "PCM_16")
    plain("eight_44100_s24_extensible.wav", 44100, 8, 301, "WAVEX", "PCM_24")
    plain("mono_96000_s24.wav", 96000, 1, 1501, "WAV", "PCM_24")
    plain("stereo_192000_s32.wav", 192000, 2, 901, "WAV", "PCM_32")
    plain("mono_44100_f32.wav", 44100, 1, 1103, "WAV", "FLOAT")
    plain("stereo_96000_f64.wav", 96000, 2, 501, "WAV", "DOUBLE")
    plain("mono_8000_alaw.wav", 8000, 1, 801, "WAV", "ALAW")
    plain("mono_8000_mulaw.wav", 8000, 1, 801, "WAV", "ULAW")
    plain("mono_44100_s16.rf64", 44100, 1, 1103, "RF64", "PCM_16")
    plain("mono_44100_s16_rifx.wav", 44100, 1, 1103, "WAV", "PCM_16", "BIG")
    plain("mono_8000_adpcm.wav", 8000, 1, 801, "WAV", "IMA_ADPCM")
    # As a program writes that cannot come back to fill in the sizes.
    for tool in ("ffmpeg", "sox"):
        source = OUT / "stereo_44100_s16.wav"
        command = {
            "ffmpeg": ["ffmpeg", "-v", "error", "-i", source, "-bitexact", "-f", "wav", "-"],
            "sox": ["sox", source, "-t", "wav", "-"],
        }[tool]
        piped = subprocess.run([str(p) for p in command], check=True, capture_output=True).stdout
        (OUT / f"stereo_44100_s16_piped_{tool}.wav").write_bytes(piped)

    plain("stereo_44100_s16.aiff", 44100, 2, 1103, "AIFF", "PCM_16")
    plain("mono_96000_s24.aiff", 96000, 1, 1501, "AIFF", "PCM_24")
    plain("mono_44100_f32.aifc", 44100, 1, 1103, "AIFF", "FLOAT")
    plain("stereo_44100_s16_sowt.aifc", 44100, 2, 1103, "AIFF", "PCM_16", "LITTLE")

    plain("stereo_44100_s16.flac", 44100, 2, 2203, "FLAC", "PCM_16")
    plain("mono_192000_s24.flac", 192000, 1, 2001, "FLAC", "PCM_24")
    plain("six_48000_s24.flac", 48000, 6, 501, "FLAC", "PCM_24")

    # Lossy: the encoders start from 16-bit WAV files of the same sound. Settings without noise or
    # low-pass to speak of, so that the comparison can be close.
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)

        def source(rate_hz, channels, frames):
            path = folder / f"{rate_hz}_{channels}_{frames}.wav"
            kind = "WAVEX" if channels > 2 else "WAV"
            sf.write(path, quantised(signal(rate_hz, channels, frames), "PCM_16"), rate_hz, "PCM_16", None, kind)
            return path

        def oggenc(name, rate_hz, channels, frames, quality=8):
            run("oggenc", "-Q", "-q", quality, "--serial", "1", source(rate_hz, channels, frames), "-o", OUT / name)

        oggenc("mono_8000_vorbis.ogg", 8000, 1, 801)
        oggenc("stereo_44100_vorbis.ogg", 44100, 2, 2205)
        oggenc("six_48000_vorbis.ogg", 48000, 6, 2401, quality=2)
        # Two pages of sound. A click late on the first makes its last block a long one that is followed
        # by a short one: there a decoder is ahead of the position that the page tells.
        clicking = signal(44100, 1, 34001)
        clicking[29920:29960] += np.where(np.arange(40) % 2, 0.3, -0.3)[:, None]
        sf.write(folder / "click.wav", quantised(clicking, "PCM_16"), 44100, "PCM_16")
        run("oggenc", "-Q", "-q", "10", "--serial", "1", folder / "click.wav", "-o", OUT / "mono_44100_pages_vorbis.ogg")

        run("ffmpeg", "-y", "-v", "error", "-i", source(44100, 2, 2205), "-c:a", "libvorbis", "-q:a", "8",
            "-bitexact", OUT / "stereo_44100_ffmpeg_vorbis.ogg")
        run("ffmpeg", "-y", "-v", "error", "-i", source(48000, 1, 2401), "-c:a", "libopus", "-bitexact",
            OUT / "mono_48000_opus.ogg")
        run("lame", "--quiet", "-b", "320", source(44100, 2, 2205), OUT / "stereo_44100.mp3")
        run("lame", "--quiet", "-V", "0", source(44100, 1, 4411), OUT / "mono_44100_variable.mp3")
        run("lame", "--quiet", "-b", "64", source(8000, 1, 1601), OUT / "mono_8000.mp3")
        run("lame", "--quiet", "-b", "128", "-t", source(44100, 1, 2205), OUT / "mono_44100_no_tag.mp3")
        run("ffmpeg", "-y", "-v", "error", "-i", source(48000, 2, 2401), "-c:a", "libmp3lame", "-b:a", "192k",
            "-metadata", "title=Known sound", "-id3v2_version", "3", OUT / "stereo_48000_ffmpeg.mp3")

    loudness()
    for path in sorted(OUT.iterdir()):
        print(f"{path.stat().st_size:8} {path.name}")


if __name__ == "__main__":
    main()
