use super::*;
use crate::scene::conventions::{Conventions, UpAxis};
use crate::scene::world::open_animation_as;
use proptest::prelude::*;

const HEADER: &str = "t,body,x,y,z,qx,qy,qz,qw,vx,vy,vz,wx,wy,wz\n";

fn read_with(text: impl Into<Vec<u8>>, columns: &PoseColumns) -> Result<PoseLog> {
    PoseLog::new(std::io::Cursor::new(text.into()), "poses.csv", columns)
}

fn fault(text: impl Into<Vec<u8>>) -> String {
    read_with(text, &PoseColumns::default()).err().map(|e| e.to_string()).unwrap_or_default()
}

#[test]
fn bodies_turn_evenly_and_go_straight_between_rows() -> Result<()> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let text = format!(
        "{HEADER}0,ball,0,0,0,0,0,0,1,1,0,0,0,0,0\n0,a,0,0,0,0,0,0,1,0,0,0,0,0,0\n1,ball,2,4,6,0,0,{half},{half},3,0,0,0,0,2\n"
    );
    let log = read_with(text, &PoseColumns::default())?;
    let paths: Vec<&str> = log.objects().iter().map(|o| o.path.as_str()).collect();
    assert_eq!(paths, ["/ball", "/a"]);
    // Half of a quarter turn about Z.
    let frame = log.transform(0, 0.5)?;
    let turned = [[half, -half, 0.0, 1.0], [half, half, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];
    for (row, expected) in frame.iter().zip(turned) {
        assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{frame:?}");
    }
    let velocity = log.velocity(0, 0.5)?;
    assert_eq!((velocity.linear_mps, velocity.angular_rps), (Some([2.0, 0.0, 0.0]), Some([0.0, 0.0, 1.0])));
    // It stands still before and after.
    assert_eq!(log.transform(0, -3.0)?[0][3], 0.0);
    assert_eq!(log.velocity(0, 3.0)?.linear_mps, Some([0.0; 3]));
    assert!(log.transform(2, 0.0).is_err() && log.mesh(0, 0.0, &mut Mesh::default()).is_err());
    Ok(())
}

#[test]
fn columns_are_found_by_their_usual_names_or_as_they_are_named() -> Result<()> {
    let usual = "Time,Name,Pos_X,Pos_Y,Pos_Z\n0,b,1,2,3\n";
    assert_eq!(read_with(usual, &PoseColumns::default())?.transform(0, 0.0)?[1][3], 2.0);
    let text = |s: &str| s.to_owned();
    let columns = PoseColumns {
        time: Some(text("when")),
        body: Some(text("who")),
        position: Some(["e", "n", "u"].map(text)),
        ..PoseColumns::default()
    };
    assert_eq!(read_with("u,n,e,who,when\n3,2,1,b,0\n", &columns)?.transform(0, 0.0)?[2][3], 3.0);
    assert_eq!(
        fault("when,body,x,y,z\n"),
        "poses.csv:1: there is no column for the time \
         (name it with `t` in `columns`; there are `when`, `body`, `x`, `y` and `z`)"
    );
    assert!(fault("t,body,x,y\n").contains("no column for the position"));
    let wrong = read_with(HEADER, &columns).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(wrong.starts_with("poses.csv:1: there is no column `when`"), "{wrong}");
    Ok(())
}

#[test]
fn axes_and_units_are_converted_with_their_velocities() -> Result<()> {
    let fail = |fault| Error::io("write", "poses.csv", fault);
    let folder = tempfile::tempdir().map_err(fail)?;
    let path = folder.path().join("poses.csv");
    std::fs::write(&path, format!("{HEADER}5,ball,100,200,300,0,0,0,1,100,200,300,1,2,3\n")).map_err(fail)?;
    let conventions = Conventions { up: Some(UpAxis::Z), unit_m: Some(0.01), ..Conventions::default() };
    let log = open_animation_as(&path, &conventions)?;
    let frame = log.transform(0, 5.0)?;
    assert_eq!([frame[0][3], frame[1][3], frame[2][3]], [1.0, 3.0, -2.0]);
    let velocity = log.velocity(0, 5.0)?;
    assert_eq!((velocity.linear_mps, velocity.angular_rps), (Some([1.0, 3.0, -2.0]), Some([1.0, 3.0, -2.0])));
    assert!(log.is_log());
    Ok(())
}

#[test]
fn faults_name_the_line_and_what_was_expected() {
    let good = "0.5,ball,0,0,0,0,0,0,1,0,0,0,0,0,0\n";
    assert!(
        fault(format!("{HEADER}{good}{}", good.replace("0.5", "0.4")))
            .starts_with("poses.csv:3: time goes back")
    );
    assert!(
        fault(format!("{HEADER}{}", good.replace(",1,", ",0,")))
            .starts_with("poses.csv:2: expected a rotation")
    );
    assert!(
        fault(format!("{HEADER}{}", good.replace("0.5", "NaN")))
            .starts_with("poses.csv:2: column `t`: expected a")
    );
    assert!(fault(format!("{HEADER}0.5,ball\n")).starts_with("poses.csv:2: expected 15 fields"));
    assert!(fault(format!("{HEADER}{}", good.replace("ball", ""))).contains("the name of a body"));
    assert_eq!(read_with(HEADER, &PoseColumns::default()).map_or(9, |log| log.objects().len()), 0);
}

#[test]
fn of_two_poses_at_one_time_the_last_counts() -> Result<()> {
    let text = "t,body,x,y,z\n0,b,1,0,0\n0,b,2,0,0\n1,b,3,0,0\n";
    let log = read_with(text, &PoseColumns::default())?;
    assert_eq!((log.objects()[0].key_times.len(), log.transform(0, 0.0)?[0][3]), (2, 2.0));
    Ok(())
}

proptest! {
    #[test]
    fn damaged_logs_are_told_not_crashed_on(cut in 0usize..600, at in 0usize..600, byte: u8, packed: bool) {
        use std::io::Write;
        let row = |t: u32, body: &str| format!("{t}.5,{body},0.5,1e3,-2,0,0.6,0,0.8,1,2,3,4,5,6\n");
        let rows: String = (0..8).map(|t| [row(t, "a"), row(t, "\"b\"")].concat()).collect();
        let mut bytes = format!("{HEADER}{rows}").into_bytes();
        if packed {
            let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
            encoder.write_all(&bytes).ok();
            bytes = encoder.finish().unwrap_or_default();
        }
        if let Some(place) = bytes.get_mut(at) { *place = byte; }
        bytes.truncate(cut);
        if let Ok(log) = read_with(bytes, &PoseColumns::default()) {
            for object in 0..log.objects().len() {
                for time_s in [f64::NAN, -1.0, 0.5, 3.7, 1e300] {
                    let frame = log.transform(object, time_s)?;
                    prop_assert!(frame.iter().flatten().all(|c| c.is_finite()) || time_s.is_nan(), "{frame:?}");
                }
            }
        }
    }
}
