//! How fast contact logs are read and analysed, in rows a second.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use froufrou::motion::body::BodyState;
use froufrou::motion::impact::{Analyser, Settings, Step};
use froufrou::motion::slide;
use froufrou::scene::contact_log::{ContactColumns, ContactLog, ContactRow, Push, UpAxis};
use froufrou::scene::pose_log::{PoseColumns, PoseLog};

fn main() {
    divan::main();
}

fn columns() -> ContactColumns {
    ContactColumns {
        time: "t".into(),
        a: "a".into(),
        b: "b".into(),
        position: ["x".into(), "y".into(), "z".into()],
        push: Push::Force("f".into()),
        normal: None,
        normal_velocity: None,
        sliding_velocity: Vec::new(),
        up: UpAxis::Y,
        unit_m: 1.0,
        time_offset_s: 0.0,
    }
}

/// A simulation of a hundred pairs of bodies that touch on and off in four points, at 1 kHz.
fn text(steps: usize) -> String {
    let mut text = String::from("t,a,b,x,y,z,f\n");
    for step in 1..=steps {
        for pair in (0..100).filter(|pair| (step / (20 + pair)) % 3 > 0) {
            for corner in 0..4 {
                let force = 10.0 + f64::from((step as u32).wrapping_mul(2_654_435_761) >> 24) * 0.1;
                let time_s = step as f64 / 1000.0;
                text += &format!("{time_s},body{pair},body{},0.{corner},1.5,-2.25,{force}\n", pair + 1);
            }
        }
    }
    text
}

#[divan::bench]
fn read(bencher: Bencher) {
    let text = text(200);
    let rows = text.lines().count() - 1;
    bencher.counter(ItemsCount::new(rows)).bench(|| {
        let log = ContactLog::new(std::io::Cursor::new(text.clone()), "bench.csv", &columns());
        black_box(log.map(|log| log.filter(Result::is_ok).count()).unwrap_or(0))
    });
}

#[divan::bench]
fn analyse(bencher: Bencher) {
    let log = ContactLog::new(std::io::Cursor::new(text(200)), "bench.csv", &columns());
    let rows: Vec<ContactRow> = log.map(|log| log.flatten().collect()).unwrap_or_default();
    bencher.counter(ItemsCount::new(rows.len())).bench(|| {
        let mut analyser = Analyser::new(Settings::new(Step::Stamped(0.001)));
        let mut blows = 0;
        for row in &rows {
            analyser.feed(row, [None; 2]).unwrap_or_default();
            while analyser.next_blow().is_some() {
                blows += 1;
            }
        }
        black_box(blows)
    });
}

/// Rubs of the same rows, of bodies whose motion is known and of such of which only the sliding is.
#[divan::bench(args = [false, true])]
fn rub(bencher: Bencher, posed: bool) {
    let log = ContactLog::new(std::io::Cursor::new(text(200)), "bench.csv", &columns());
    let rows: Vec<ContactRow> = log.map(|log| log.flatten().collect()).unwrap_or_default();
    let rows: Vec<ContactRow> =
        rows.into_iter().map(|row| ContactRow { sliding_mps: (!posed).then_some(0.1), ..row }).collect();
    let state = BodyState { velocity_mps: [0.1, 0.0, 0.0], ..BodyState::STILL };
    let states = [posed.then_some(state), None];
    bencher.counter(ItemsCount::new(rows.len())).bench(|| {
        let mut analyser = slide::Analyser::new(Step::Stamped(0.001));
        let mut moments = 0;
        for row in &rows {
            analyser.feed(row, states);
            while analyser.pop().is_some() {
                moments += 1;
            }
        }
        black_box(moments)
    });
}

/// A log of the poses and velocities of a hundred bodies.
#[divan::bench]
fn poses(bencher: Bencher) {
    let mut text = String::from("t,body,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz\n");
    for row in 0..20_000 {
        let time_s = f64::from(row / 100) / 1000.0;
        text += &format!("{time_s},body{},0.5,1.25,-2.75,0,0.6,0,0.8,1.5,0.25,-0.75,3,2,1\n", row % 100);
    }
    bencher.counter(ItemsCount::new(20_000usize)).bench(|| {
        let log = PoseLog::new(std::io::Cursor::new(text.clone()), "bench.csv", &PoseColumns::default());
        black_box(log.is_ok())
    });
}
