//! An animation in other units, or with another axis up, brought to metres and Y up.
//!
//! With *C* the turn of the axes times the unit, a position becomes *C p*. A transform is turned
//! likewise, but only its translation takes the unit on: its local frame is then one in metres as
//! well, and what is so many metres beside an object stays so. Local axes stay those of the file, so
//! that a camera still looks along its −Z. A turn and a unit above 0 leave faces as they wind.

use std::sync::Arc;

use super::animation::{Animation, Mesh, MeshSize, ObjectInfo, Stated, StatedVelocity, Transform};
use super::conventions::{Conventions, UpAxis};
use crate::Result;

/// A quarter of a turn about X, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    None,
    /// Z comes up: (x, y, z) becomes (x, z, −y).
    ZUp,
    /// The other way round, for a file that says Z and means Y.
    YUp,
}

impl Turn {
    /// The three of anything that goes with the axes: coordinates, or rows of a matrix.
    fn apply<T>(self, [x, y, z]: [T; 3], negated: impl Fn(T) -> T) -> [T; 3] {
        match self {
            Turn::None => [x, y, z],
            Turn::ZUp => [x, z, negated(y)],
            Turn::YUp => [x, negated(z), y],
        }
    }
}

/// An animation that is brought to metres and Y up.
pub(crate) struct Converted {
    inner: Arc<dyn Animation>,
    turn: Turn,
    /// Metres per metre of the inner animation.
    scale: f64,
}

impl Converted {
    /// The animation by these conventions; itself, where they change nothing.
    pub(crate) fn wrap(inner: Arc<dyn Animation>, conventions: &Conventions) -> Arc<dyn Animation> {
        let stated = inner.stated();
        let turn = match (stated.up, conventions.up.unwrap_or(stated.up)) {
            (UpAxis::Y, UpAxis::Z) => Turn::ZUp,
            (UpAxis::Z, UpAxis::Y) => Turn::YUp,
            _ => Turn::None,
        };
        let scale = conventions.unit_m.map_or(1.0, |unit_m| unit_m / stated.unit_m);
        if turn == Turn::None && scale == 1.0 { inner } else { Arc::new(Self { inner, turn, scale }) }
    }
}

impl Animation for Converted {
    fn objects(&self) -> &[ObjectInfo] {
        self.inner.objects()
    }

    fn transform(&self, object: usize, time_s: f64) -> Result<Transform> {
        let [x, y, z, last] = self.inner.transform(object, time_s)?;
        let [x, y, z] = self.turn.apply([x, y, z], |row| row.map(|c| -c));
        let in_metres = |[a, b, c, translation]: [f64; 4]| [a, b, c, translation * self.scale];
        Ok([in_metres(x), in_metres(y), in_metres(z), last])
    }

    fn mesh(&self, object: usize, time_s: f64, mesh: &mut Mesh) -> Result<()> {
        self.inner.mesh(object, time_s, mesh)?;
        for position in &mut mesh.positions {
            let scaled = position.map(|c| (f64::from(c) * self.scale) as f32);
            *position = self.turn.apply(scaled, |c| -c);
        }
        Ok(())
    }

    fn vertex_values(&self, object: usize, name: &str, time_s: f64, values: &mut Vec<f32>) -> Result<()> {
        self.inner.vertex_values(object, name, time_s, values)
    }

    fn mesh_size(&self, object: usize) -> Result<Option<MeshSize>> {
        self.inner.mesh_size(object)
    }

    fn velocity(&self, object: usize, time_s: f64) -> Result<StatedVelocity> {
        let StatedVelocity { linear_mps, angular_rps } = self.inner.velocity(object, time_s)?;
        let turned = |v: [f64; 3]| self.turn.apply(v, |c| -c);
        Ok(StatedVelocity {
            linear_mps: linear_mps.map(|v| turned(v).map(|c| c * self.scale)),
            angular_rps: angular_rps.map(turned),
        })
    }

    fn is_log(&self) -> bool {
        self.inner.is_log()
    }

    fn stated(&self) -> Stated {
        self.inner.stated()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::animation::{KeyTimes, ObjectKind, Topology};
    use crate::scene::track::facing_frame;

    /// A camera and a triangle, in a file that states this of itself.
    struct Still {
        objects: Vec<ObjectInfo>,
        frame: Transform,
        stated: Stated,
    }

    impl Animation for Still {
        fn objects(&self) -> &[ObjectInfo] {
            &self.objects
        }

        fn transform(&self, _: usize, _: f64) -> Result<Transform> {
            Ok(self.frame)
        }

        fn mesh(&self, _: usize, _: f64, mesh: &mut Mesh) -> Result<()> {
            *mesh = Mesh {
                positions: vec![[100.0, 200.0, 300.0], [0.0, f32::NAN, 0.0], [0.0, 0.0, 50.0]],
                face_vertices: vec![0, 1, 2],
                face_sizes: vec![3],
            };
            Ok(())
        }

        fn stated(&self) -> Stated {
            self.stated
        }
    }

    fn still(stated: Stated) -> Arc<dyn Animation> {
        let info = ObjectInfo {
            path: "/o".into(),
            kind: ObjectKind::Mesh,
            topology: Topology::Constant,
            key_times: KeyTimes::Static,
        };
        // Looks along +X from (100, 200, 300), its up +Z: as a level camera where Z is up.
        let frame =
            [[0.0, 0.0, -1.0, 100.0], [-1.0, 0.0, 0.0, 200.0], [0.0, 1.0, 0.0, 300.0], [0.0, 0.0, 0.0, 1.0]];
        Arc::new(Still { objects: vec![info], frame, stated })
    }

    fn conventions(up: Option<UpAxis>, unit_m: Option<f64>) -> Conventions {
        Conventions { up, unit_m, ..Conventions::default() }
    }

    #[test]
    fn centimetres_with_z_up_become_metres_with_y_up() {
        let animation = Converted::wrap(still(Stated::default()), &conventions(Some(UpAxis::Z), Some(0.01)));
        // A level camera that looks along +X, as a hand-set one at that place does; not scaled.
        let frame = animation.transform(0, 0.0).unwrap();
        let expected = facing_frame([1.0, 3.0, -2.0], [1.0, 0.0, 0.0]);
        assert!((0..4).all(|r| (0..4).all(|c| (frame[r][c] - expected[r][c]).abs() < 1e-15)), "{frame:?}");
        let mut mesh = Mesh::default();
        animation.mesh(0, 0.0, &mut mesh).unwrap();
        assert_eq!((mesh.positions[0], mesh.positions[2]), ([1.0, 3.0, -2.0], [0.0, 0.5, -0.0]));
        assert!(mesh.positions[1][2].is_nan() && mesh.positions[1][0] == 0.0);
        // The turn is a rotation: what was outside is outside.
        assert_eq!(mesh.face_vertices, [0, 1, 2]);
        assert_eq!(animation.mesh_size(0).unwrap().unwrap().vertices, 3);
    }

    #[test]
    fn what_is_said_goes_before_what_the_file_states() {
        let stated = Stated { up: UpAxis::Z, unit_m: 0.01 };
        let place = |animation: Arc<dyn Animation>| {
            let frame = animation.transform(0, 0.0).unwrap();
            [frame[0][3], frame[1][3], frame[2][3]]
        };
        // The reader has applied what the file states; to say it again changes nothing.
        for same in [conventions(None, None), conventions(Some(UpAxis::Z), Some(0.01))] {
            assert_eq!(place(Converted::wrap(still(stated), &same)), [100.0, 200.0, 300.0]);
        }
        // It was in metres and Y up after all: (x, y, z) had been made (x, z, −y) / 100.
        let found = place(Converted::wrap(still(stated), &conventions(Some(UpAxis::Y), Some(1.0))));
        assert_eq!(found, [10_000.0, -30_000.0, 20_000.0]);
    }
}
