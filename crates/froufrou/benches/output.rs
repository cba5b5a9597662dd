//! What writing a soundtrack costs: WAV beside FLAC, a sample.
//!
//! ```text
//! cargo bench -p froufrou --bench output
//! ```
//!
//! Each row writes ten seconds of stereo at 48 kHz: a few decaying tones over soft noise. `items/s`
//! counts samples of all channels. FLAC is encoded on one core here; a render encodes on all.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::render::flac::FlacWriter;
use froufrou::render::format::{SampleFormat, SoundFormat};
use froufrou::render::meter::Meter;
use froufrou::render::wav::WavWriter;

fn main() {
    divan::main();
}

fn sound() -> Vec<f32> {
    let random = froufrou::random::Random::new(1, 0);
    let tone = |i: u64, hz: f64| {
        let t = (i % 24_000) as f64 / 48_000.0;
        (std::f64::consts::TAU * hz * t).sin() * (-6.0 * t).exp()
    };
    let noise = |index: u64| 0.002 * (random.uniform(index) - 0.5);
    (0..480_000u64)
        .flat_map(|i| {
            let both = 0.2 * tone(i, 440.0) + 0.1 * tone(i, 1710.0);
            [0.9 * both + noise(2 * i), 0.5 * both + 0.1 * tone(i, 660.0) + noise(2 * i + 1)]
        })
        .map(|sample| sample as f32)
        .collect()
}

fn format(samples: SampleFormat) -> SoundFormat {
    SoundFormat { rate_hz: 48_000, channels: 2, samples, seed: 0, first_frame: 0 }
}

const FORMATS: [SampleFormat; 2] = [SampleFormat::Int16, SampleFormat::Int24];

#[divan::bench(args = FORMATS, sample_count = 5)]
fn wav(bencher: Bencher, samples: SampleFormat) {
    let (sound, folder) = (sound(), tempfile::tempdir().expect("a folder"));
    bencher.counter(ItemsCount::new(sound.len())).bench_local(|| {
        let path = folder.path().join("x.wav");
        let mut writer = WavWriter::create(path, format(samples)).expect("a file");
        sound.chunks(65_536).for_each(|block| writer.write(block).expect("room"));
        black_box(writer.finish().expect("room"));
    });
}

#[divan::bench(args = FORMATS, sample_count = 5)]
fn flac(bencher: Bencher, samples: SampleFormat) {
    let (sound, folder) = (sound(), tempfile::tempdir().expect("a folder"));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let path = folder.path().join("x.flac");
    bencher.counter(ItemsCount::new(sound.len())).bench_local(|| {
        pool.install(|| {
            let mut writer = FlacWriter::create(&path, format(samples)).expect("a file");
            sound.chunks(65_536).for_each(|block| writer.write(block).expect("room"));
            black_box(writer.finish().expect("room"));
        });
    });
}

#[divan::bench(sample_count = 5)]
fn meter(bencher: Bencher) {
    let sound = sound();
    bencher.counter(ItemsCount::new(sound.len())).bench_local(|| {
        let mut meter = Meter::new(48_000, 2).expect("a meter");
        sound.chunks(65_536).for_each(|block| meter.add(block).expect("whole frames"));
        black_box(meter.finish());
    });
}
