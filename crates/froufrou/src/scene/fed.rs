//! How something moves that is told while it does.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use super::animation::{Mesh, Transform, mix_positions};
use crate::{Error, Result};

/// So many frames of a mesh are kept.
const FRAMES: usize = 3;

/// Poses are kept for so long behind the last, in seconds.
const KEPT_S: f64 = 4.0;

/// Where something is and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FedPose {
    /// In metres.
    pub position_m: [f64; 3],
    /// A quaternion x, y, z, w of any length above 0. Unturned, it looks along −Z and its up is +Y.
    pub rotation: [f64; 4],
}

impl FedPose {
    /// At a place, unturned.
    pub fn at(position_m: [f64; 3]) -> Self {
        Self { position_m, rotation: [0.0, 0.0, 0.0, 1.0] }
    }
}

/// The faces of a mesh.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Faces {
    /// The vertex indices of all faces, one face after another, counter-clockwise seen from outside.
    pub vertices: Vec<u32>,
    /// The number of vertices of each face.
    pub sizes: Vec<u32>,
}

impl Faces {
    /// Says why they cannot be those of so many vertices, if they cannot.
    ///
    /// # Errors
    /// What does not fit.
    pub fn check(&self, vertices: usize) -> Result<()> {
        let corners: u64 = self.sizes.iter().map(|&size| u64::from(size)).sum();
        if corners != self.vertices.len() as u64 {
            let what = format!("its faces have {corners} corners, and {} are told", self.vertices.len());
            return Err(Error::new(what));
        }
        match self.vertices.iter().find(|&&vertex| vertex as usize >= vertices) {
            Some(vertex) => Err(Error::new(format!("a face has vertex {vertex}; there are {vertices}"))
                .help("they are counted from 0")),
            None => Ok(()),
        }
    }
}

/// A mesh at one time.
#[derive(Debug, Clone)]
struct Frame {
    time_s: f64,
    positions: Arc<[[f32; 3]]>,
    faces: Arc<Faces>,
}

/// The poses of something, as they are told, and the frames of its mesh, if it has one. Between two it goes evenly from one
/// to the other; before the first and behind the last it stands.
#[derive(Debug)]
pub struct Fed {
    poses: Mutex<VecDeque<(f64, FedPose)>>,
    mesh: Option<Mutex<VecDeque<Frame>>>,
}

/// It is itself.
impl PartialEq for Fed {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Fed {
    /// Something that stands until it is told otherwise.
    pub fn new(pose: FedPose) -> Self {
        Self { poses: Mutex::new(VecDeque::from([(0.0, pose)])), mesh: None }
    }

    /// Something with a mesh, which stays as it is until it is told otherwise.
    ///
    /// # Errors
    /// Faces that are not those of so many vertices.
    pub fn with_mesh(pose: FedPose, rest: Mesh) -> Result<Self> {
        let faces = Faces { vertices: rest.face_vertices, sizes: rest.face_sizes };
        faces.check(rest.positions.len())?;
        let frame = Frame { time_s: 0.0, positions: rest.positions.into(), faces: faces.into() };
        Ok(Self { mesh: Some(Mutex::new(VecDeque::from([frame]))), ..Self::new(pose) })
    }

    /// Whether it has a mesh.
    pub fn has_mesh(&self) -> bool {
        self.mesh.is_some()
    }

    /// Its vertices are there at a time, in the world and in metres, which is not before that of the last frame; its faces
    /// are as before, or these.
    ///
    /// # Errors
    /// Something without a mesh; vertices that its faces are not of.
    pub fn push_mesh(
        &self,
        time_s: f64,
        positions: Arc<[[f32; 3]]>,
        faces: Option<Arc<Faces>>,
    ) -> Result<()> {
        let Some(mesh) = &self.mesh else { return Err(Error::new("it has no mesh")) };
        let mut frames = mesh.lock().unwrap_or_else(PoisonError::into_inner);
        let before = frames.back().map(|frame| frame.faces.clone()).unwrap_or_default();
        let faces = faces.unwrap_or(before);
        faces.check(positions.len())?;
        if frames.back().is_some_and(|last| last.time_s >= time_s) {
            frames.pop_back();
        }
        frames.push_back(Frame { time_s, positions, faces });
        while frames.len() > FRAMES {
            frames.pop_front();
        }
        Ok(())
    }

    /// Its mesh at a time; false where it has none.
    pub fn mesh(&self, time_s: f64, into: &mut Mesh) -> bool {
        let Some(mesh) = &self.mesh else { return false };
        let frames = mesh.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((before, next)) = around(&frames, time_s) else { return false };
        into.positions.clear();
        match next {
            Some((next, along)) => {
                mix_positions(&before.positions, &next.positions, along, &mut into.positions);
            }
            None => into.positions.extend_from_slice(&before.positions),
        }
        into.face_vertices.clone_from(&before.faces.vertices);
        into.face_sizes.clone_from(&before.faces.sizes);
        true
    }

    /// Where one of the vertices of its mesh is at a time, in metres; nothing where there is none of that number.
    pub fn vertex_m(&self, vertex: usize, time_s: f64) -> Option<[f64; 3]> {
        let frames = self.mesh.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        let (before, next) = around(&frames, time_s)?;
        let mut at = Vec::with_capacity(1);
        let own = |frame: &Frame| frame.positions.get(vertex).copied();
        match next {
            Some((next, along)) => mix_positions(&[own(before)?], &[own(next)?], along, &mut at),
            None => at.push(own(before)?),
        }
        Some(at.first()?.map(f64::from))
    }

    /// It has a pose at a time, which is not before that of the last. One of the same time takes its place.
    pub fn push(&self, time_s: f64, pose: FedPose) {
        let mut poses = self.poses.lock().unwrap_or_else(PoisonError::into_inner);
        if poses.back().is_some_and(|(last_s, _)| *last_s >= time_s) {
            poses.pop_back();
        }
        poses.push_back((time_s, pose));
        while poses.get(1).is_some_and(|(next_s, _)| *next_s < time_s - KEPT_S) {
            poses.pop_front();
        }
    }

    /// Until a time it has stood where it was last.
    pub fn stand(&self, time_s: f64) {
        let last = self.poses.lock().unwrap_or_else(PoisonError::into_inner).back().copied();
        if let Some((last_s, pose)) = last
            && last_s < time_s
        {
            self.push(time_s, pose);
        }
    }

    /// Its local-to-world transform at a time.
    pub fn frame(&self, time_s: f64) -> Transform {
        let poses = self.poses.lock().unwrap_or_else(PoisonError::into_inner);
        let after = poses.partition_point(|(pose_s, _)| *pose_s <= time_s);
        let before = after.checked_sub(1).and_then(|index| poses.get(index)).or(poses.front());
        let Some(&(from_s, from)) = before else { return super::animation::IDENTITY };
        let turn = |pose: FedPose| glam::DQuat::from_array(pose.rotation).normalize();
        let (at, turned) = match poses.get(after) {
            Some(&(to_s, to)) if to_s > from_s && time_s > from_s => {
                let along = (time_s - from_s) / (to_s - from_s);
                let at = |i: usize| from.position_m[i] + along * (to.position_m[i] - from.position_m[i]);
                (std::array::from_fn(at), turn(from).slerp(turn(to), along))
            }
            _ => (from.position_m, turn(from)),
        };
        let columns = glam::DMat3::from_quat(turned).to_cols_array_2d();
        let row = |i: usize| [columns[0][i], columns[1][i], columns[2][i], at[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }
}

/// The frame before a time, and the one after it with how far the time is on the way there, where a way leads there.
fn around(frames: &VecDeque<Frame>, time_s: f64) -> Option<(&Frame, Option<(&Frame, f64)>)> {
    let after = frames.partition_point(|frame| frame.time_s <= time_s);
    let before = after.checked_sub(1).and_then(|at| frames.get(at)).or(frames.front())?;
    let is_way = |next: &&Frame| {
        let is_same = next.faces == before.faces && next.positions.len() == before.positions.len();
        before.time_s < time_s && is_same
    };
    let next = frames.get(after).filter(is_way);
    Some((before, next.map(|next| (next, (time_s - before.time_s) / (next.time_s - before.time_s)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_where_it_is_told_and_evenly_between() {
        let triangle = |x: f32| [[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let rest =
            Mesh { positions: triangle(0.0).to_vec(), face_vertices: vec![0, 1, 2], face_sizes: vec![3] };
        let fed = Fed::with_mesh(FedPose::at([0.0; 3]), rest).unwrap();
        let at = |time_s: f64| {
            let mut mesh = Mesh::default();
            assert!(fed.mesh(time_s, &mut mesh));
            (mesh.positions[0][0], mesh.face_sizes.len())
        };
        assert_eq!((at(-1.0), at(3.0)), ((0.0, 1), (0.0, 1)));
        fed.push_mesh(1.0, triangle(2.0).into(), None).unwrap();
        fed.push_mesh(2.0, triangle(4.0).into(), None).unwrap();
        assert_eq!((at(0.5), at(1.0), at(1.5), at(9.0)), ((1.0, 1), (2.0, 1), (3.0, 1), (4.0, 1)));
        // Where faces change nothing leads from one mesh to the other.
        let faces =
            |vertices: Vec<u32>| Some(Arc::new(Faces { sizes: vec![3; vertices.len() / 3], vertices }));
        let four = [triangle(6.0).as_slice(), &[[1.0, 1.0, 0.0]]].concat();
        fed.push_mesh(3.0, four.clone().into(), faces(vec![0, 1, 2, 1, 3, 2])).unwrap();
        assert_eq!((at(2.5), at(3.0)), ((4.0, 1), (6.0, 2)));
        let fault = fed.push_mesh(4.0, triangle(0.0).into(), None).unwrap_err().to_string();
        assert!(fault.contains("vertex 3; there are 3"), "{fault}");
        let fault = fed.push_mesh(4.0, four.into(), faces(vec![0, 1])).unwrap_err().to_string();
        assert!(fault.contains("0 corners"), "{fault}");
        assert_eq!(at(9.0), (6.0, 2));
        assert!(Fed::new(FedPose::at([0.0; 3])).push_mesh(0.0, triangle(0.0).into(), None).is_err());
    }

    #[test]
    fn it_goes_evenly_and_stands_where_it_is_told_nothing() {
        let fed = Fed::new(FedPose::at([1.0, 2.0, 3.0]));
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let place = |time_s: f64| fed.frame(time_s).map(|row| row[3]);
        assert_eq!((place(-1.0), place(9.0)), ([1.0, 2.0, 3.0, 1.0], [1.0, 2.0, 3.0, 1.0]));
        fed.stand(2.0);
        // To the left by a quarter turn: what was ahead is at −X.
        fed.push(4.0, FedPose { position_m: [3.0, 2.0, 3.0], rotation: [0.0, 2.0 * half, 0.0, 2.0 * half] });
        assert_eq!((place(2.0)[0], place(3.0)[0], place(5.0)[0]), (1.0, 2.0, 3.0));
        let ahead = |time_s: f64| fed.frame(time_s).map(|row| -row[2]);
        let near = |a: [f64; 4], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(ahead(4.0), [-1.0, 0.0, 0.0]));
        assert!(near(ahead(3.0), [-half, 0.0, -half]), "half way, half turned");
        (0..10_000).for_each(|n| fed.push(4.0 + f64::from(n) * 0.01, FedPose::at([0.0; 3])));
        assert!(fed.poses.lock().unwrap().len() < 500);
    }
}
