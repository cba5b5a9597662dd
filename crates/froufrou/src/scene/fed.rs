//! How something moves that is told while it does.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::animation::{Mesh, Transform, mix_positions};
use crate::{Error, Result};

/// So many frames of a mesh are kept at most: those of two seconds, 240 in each, that time goes on by at once.
const MOST_FRAMES: usize = 512;

/// Frames of a mesh are kept for so long behind what was known before time went on last, in seconds: what is asked where it
/// was a moment ago.
const FRAMES_KEPT_S: f64 = 0.1;

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

    fn turn(&self) -> glam::DQuat {
        glam::DQuat::from_array(self.rotation).normalize()
    }

    /// Brings what lies in the world as it does to this pose to where it lies so to another one.
    pub fn move_to(&self, other: &Self, positions_m: &mut [[f32; 3]]) {
        let [from, to] = [self, other].map(|pose| glam::DVec3::from(pose.position_m));
        let turn = other.turn() * self.turn().inverse();
        for position in positions_m {
            let away = glam::DVec3::from(position.map(f64::from)) - from;
            *position = (to + turn * away).as_vec3().into();
        }
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

impl Frame {
    /// Whether it is the very same mesh, at whatever time.
    fn is_still(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.positions, &other.positions) && Arc::ptr_eq(&self.faces, &other.faces)
    }
}

/// The frames of a mesh that may be asked for yet.
#[derive(Debug)]
struct Frames {
    /// In order of time, one at least.
    all: VecDeque<Frame>,
    /// Whether one was told.
    are_told: bool,
    /// Up to here all was known when time went on last.
    known_s: f64,
}

impl Frames {
    /// What was told of later times is forgotten. Where very many come before time goes on the one before gives way: it goes
    /// evenly past it.
    fn push(&mut self, frame: Frame) {
        while self.all.back().is_some_and(|last| last.time_s >= frame.time_s) {
            self.all.pop_back();
        }
        if self.all.len() >= MOST_FRAMES {
            self.all.pop_back();
        }
        self.all.push_back(frame);
    }

    fn stand(&mut self, time_s: f64) {
        if let Some(last) = self.all.back().filter(|last| last.time_s < time_s).cloned() {
            // What stands for long is there once for its beginning and once for its end.
            if self.all.iter().nth_back(1).is_some_and(|before| before.is_still(&last)) {
                self.all.pop_back();
            }
            self.push(Frame { time_s, ..last });
        }
        let needed_s = self.known_s.min(time_s) - FRAMES_KEPT_S;
        while self.all.get(1).is_some_and(|next| next.time_s <= needed_s) {
            self.all.pop_front();
        }
        self.known_s = time_s;
    }
}

/// The mesh of something.
#[derive(Debug)]
struct ToldMesh {
    /// As it was before anything was told.
    first: Frame,
    frames: Mutex<Frames>,
}

impl ToldMesh {
    fn frames(&self) -> MutexGuard<'_, Frames> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The poses of something, as they are told, and the frames of its mesh, if it has one. Between two it goes evenly from one
/// to the other; before the first and behind the last it stands.
#[derive(Debug)]
pub struct Fed {
    first: FedPose,
    poses: Mutex<VecDeque<(f64, FedPose)>>,
    mesh: Option<ToldMesh>,
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
        Self { first: pose, poses: Mutex::new(VecDeque::from([(0.0, pose)])), mesh: None }
    }

    /// Something with a mesh, which stays as it is until it is told otherwise.
    ///
    /// # Errors
    /// Faces that are not those of so many vertices.
    pub fn with_mesh(pose: FedPose, rest: Mesh) -> Result<Self> {
        let faces = Faces { vertices: rest.face_vertices, sizes: rest.face_sizes };
        faces.check(rest.positions.len())?;
        let first = Frame { time_s: 0.0, positions: rest.positions.into(), faces: faces.into() };
        let frames = Frames { all: VecDeque::from([first.clone()]), are_told: false, known_s: 0.0 };
        Ok(Self { mesh: Some(ToldMesh { first, frames: Mutex::new(frames) }), ..Self::new(pose) })
    }

    /// Whether it has a mesh.
    pub fn has_mesh(&self) -> bool {
        self.mesh.is_some()
    }

    /// Whether a frame of its mesh was told.
    pub fn is_mesh_told(&self) -> bool {
        self.mesh.as_ref().is_some_and(|mesh| mesh.frames().are_told)
    }

    /// Where it was before it was told anything.
    pub fn first_pose(&self) -> FedPose {
        self.first
    }

    /// Its mesh before it was told anything; nothing where it has none.
    pub fn first_mesh(&self) -> Option<Mesh> {
        let Frame { positions, faces, .. } = &self.mesh.as_ref()?.first;
        let Faces { vertices, sizes } = Faces::clone(faces);
        Some(Mesh { positions: positions.to_vec(), face_vertices: vertices, face_sizes: sizes })
    }

    /// Its vertices are there at a time, in the world and in metres; its faces are as before, or these. What was told of that
    /// time and of later ones is forgotten.
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
        let mut frames = mesh.frames();
        let before = frames.all.back().map(|frame| frame.faces.clone()).unwrap_or_default();
        let faces = faces.unwrap_or(before);
        faces.check(positions.len())?;
        frames.push(Frame { time_s, positions, faces });
        frames.are_told = true;
        Ok(())
    }

    /// Its mesh at a time; false where it has none.
    pub fn mesh(&self, time_s: f64, into: &mut Mesh) -> bool {
        let Some(mesh) = &self.mesh else { return false };
        let frames = mesh.frames();
        let Some((before, next)) = around(&frames.all, time_s) else { return false };
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
        let frames = self.mesh.as_ref()?.frames();
        let (before, next) = around(&frames.all, time_s)?;
        let mut at = Vec::with_capacity(1);
        let own = |frame: &Frame| frame.positions.get(vertex).copied();
        match next {
            Some((next, along)) => mix_positions(&[own(before)?], &[own(next)?], along, &mut at),
            None => at.push(own(before)?),
        }
        Some(at.first()?.map(f64::from))
    }

    /// It has a pose at a time. What was told of that time and of later ones is forgotten.
    pub fn push(&self, time_s: f64, pose: FedPose) {
        let mut poses = self.poses.lock().unwrap_or_else(PoisonError::into_inner);
        while poses.back().is_some_and(|(last_s, _)| *last_s >= time_s) {
            poses.pop_back();
        }
        poses.push_back((time_s, pose));
        while poses.get(1).is_some_and(|(next_s, _)| *next_s < time_s - KEPT_S) {
            poses.pop_front();
        }
    }

    /// All is known up to a time: until then it has stood where it was last, and its mesh as it was. It may be asked where it
    /// was since the time before, and a tenth of a second earlier.
    pub fn stand(&self, time_s: f64) {
        if let Some(mesh) = &self.mesh {
            mesh.frames().stand(time_s);
        }
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
        let (at, turned) = match poses.get(after) {
            Some(&(to_s, to)) if to_s > from_s && time_s > from_s => {
                let along = (time_s - from_s) / (to_s - from_s);
                let at = |i: usize| from.position_m[i] + along * (to.position_m[i] - from.position_m[i]);
                (std::array::from_fn(at), from.turn().slerp(to.turn(), along))
            }
            _ => (from.position_m, from.turn()),
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
        before.time_s < time_s && is_same && !next.is_still(before)
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
