//! Pose logs, plain and gzipped, alone and as the motion of the bodies of a contact log that is thinned.
#![no_main]

use froufrou::motion::contacts::LogEvents;
use froufrou::scene::Scene;
use froufrou::scene::pose_log::{PoseColumns, PoseLog};
use froufrou::scene::world::{RigidBodies, World};
use froufrou_fuzz::{target, walk_animation, walk_events};

/// A body on the ground at ten times a second, of a simulation at a thousand.
const CONTACTS: &str = "t,a,b,x,y,z,F,nx,ny,nz\n0.1,b,g,0,0,0,9,0,1,0\n0.2,b,g,0,0,0,9,0,1,0\n\
                        0.3,b,c,0,0,0,9,0,1,0\n0.5,b,g,0,0,0,9,0,1,0\n";

const SCENE: &str = r#"
[[object]]
name = "bodies"
body = "*"
source = "poses.csv#*"

[[contacts]]
log = "contacts.csv"
step = 0.001
columns = { t = "t", a = "a", b = "b", position = ["x", "y", "z"], normal_force = "F", normal = ["nx", "ny", "nz"] }
"#;

target!(|bytes| {
    let columns = PoseColumns::default();
    let Ok(log) = PoseLog::new(std::io::Cursor::new(bytes.to_vec()), "poses.csv", &columns) else { return };
    walk_animation(&log);
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("poses.csv"), bytes).expect("room for a file");
    std::fs::write(folder.path().join("contacts.csv"), CONTACTS).expect("room for a file");
    let Ok(scene) = Scene::parse(SCENE, folder.path().join("scene.toml"), false) else { return };
    let Ok(world) = World::open(&scene) else { return };
    let Ok(events) = LogEvents::open(&scene.contacts[0], RigidBodies::of(&scene, &world)) else { return };
    walk_events(events);
});
