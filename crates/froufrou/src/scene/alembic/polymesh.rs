//! Polygon meshes: points that move, and faces that mostly do not.
//!
//! Subdivision surfaces hold the same three lists for their control cage and are read as that.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::archive::{Archive, Compound};
use super::fault::{Allowance, Fault, Outcome};
use super::ogawa::Ogawa;
use super::property::Property;
use super::time_sampling::union;
use crate::scene::animation::{KeyTimes, Mesh, MeshSize, Topology};
use crate::scene::sample_cache::{Ledger, SampleCache};

/// The most bytes of the index of a property with indices of its own.
const INDEXED: u64 = 1 << 16;

/// A mesh of which some or all properties change.
#[derive(Debug)]
pub(super) struct PolyMesh {
    /// Points; none where the mesh never had a sample.
    points: Option<Property>,
    /// Vertex indices, face after face, clockwise seen from outside.
    indices: Option<Property>,
    /// Vertices of each face.
    counts: Option<Property>,
    /// What its writer has put beside them.
    arbitrary: Option<Compound>,
    point_cache: SampleCache<u32, Vec<[f32; 3]>>,
    face_cache: SampleCache<(u32, u32), Faces>,
}

/// The faces of one sample, sound in themselves.
#[derive(Debug, Default, PartialEq)]
struct Faces {
    /// Counter-clockwise, unlike the file's.
    vertices: Vec<u32>,
    sizes: Vec<u32>,
    /// How many vertices there must be.
    vertices_needed: usize,
}

impl PolyMesh {
    /// From its schema's compound, and that within it of what its writer has put beside.
    ///
    /// # Errors
    /// Damage.
    pub(super) fn new(
        compound: &Compound,
        arbitrary: Option<Compound>,
        archive: &Archive,
        ledger: &Arc<Ledger>,
    ) -> Outcome<Self> {
        let property = |name: &str| -> Outcome<_> {
            Ok(compound.property(name, archive)?.filter(|property| !property.is_empty()))
        };
        Ok(Self {
            points: property("P")?,
            indices: property(".faceIndices")?,
            counts: property(".faceCounts")?,
            arbitrary,
            point_cache: SampleCache::new(ledger),
            face_cache: SampleCache::new(ledger),
        })
    }

    fn properties(&self) -> impl Iterator<Item = &Property> {
        [&self.points, &self.indices, &self.counts].into_iter().flatten()
    }

    /// How it changes, its transforms aside.
    pub(super) fn topology(&self) -> Topology {
        let constant = |property: &Option<Property>| property.as_ref().is_none_or(Property::is_constant);
        if !constant(&self.indices) || !constant(&self.counts) {
            Topology::Heterogeneous
        } else if !constant(&self.points) {
            Topology::Homogeneous
        } else {
            Topology::Constant
        }
    }

    /// When it changes.
    ///
    /// # Errors
    /// Times too many for the allowance.
    pub(super) fn key_times(&self, memory: &mut Allowance) -> Outcome<KeyTimes> {
        let mut times = KeyTimes::Static;
        for property in self.properties() {
            times = union(&times, &property.key_times(memory)?, memory)?;
        }
        Ok(times)
    }

    /// Vertices and faces of the first sample, without reading them.
    ///
    /// # Errors
    /// Damage.
    pub(super) fn first_size(&self, ogawa: &Ogawa) -> Outcome<MeshSize> {
        let elements = |property: &Option<Property>| {
            let elements = property.as_ref().map_or(Ok(0), |property| property.elements(0, ogawa))?;
            usize::try_from(elements).map_err(|_| Fault::damage(0, format!("{elements} elements in a mesh")))
        };
        Ok(MeshSize { vertices: elements(&self.points)?, faces: elements(&self.counts)? })
    }

    /// The mesh at a time, moved by `world`.
    ///
    /// # Errors
    /// A sample that cannot be read or whose faces name vertices that are not there.
    pub(super) fn read(&self, time_s: f64, world: DAffine3, ogawa: &Ogawa, mesh: &mut Mesh) -> Outcome<()> {
        mesh.positions.clear();
        mesh.face_vertices.clear();
        mesh.face_sizes.clear();
        let Some(points) = &self.points else { return Ok(()) };
        let bracket = points.bracket(time_s);
        // The faces that belong to a sample of points are those of its time.
        let time_of = |index| if points.is_constant() { time_s } else { points.time_s(index) };
        let faces = self.faces(time_of(bracket.floor), ogawa)?;
        let (floor, ceiling) = (points.stored(bracket.floor), points.stored(bracket.ceiling));
        let before = self.points(points, floor, ogawa)?;
        let transform = |point: DVec3| world.transform_point3(point).as_vec3().to_array();
        let of = |point: &[f32; 3]| DVec3::from(point.map(f64::from));
        let after = if floor == ceiling { None } else { Some(self.points(points, ceiling, ogawa)?) };
        let alike = |after: &Vec<[f32; 3]>| -> Outcome<bool> {
            let faces_after = self.faces(time_of(bracket.ceiling), ogawa)?;
            Ok(after.len() == before.len() && (Arc::ptr_eq(&faces, &faces_after) || faces == faces_after))
        };
        match after {
            Some(after) if alike(&after)? => {
                let pairs = before.iter().zip(after.iter());
                mesh.positions.extend(pairs.map(|(a, b)| transform(of(a).lerp(of(b), bracket.fraction))));
            }
            _ => mesh.positions.extend(before.iter().map(|point| transform(of(point)))),
        }
        if faces.vertices_needed > before.len() {
            return Err(Fault::new(
                format!(
                    "the faces name vertex {}, but there are {}",
                    faces.vertices_needed - 1,
                    before.len()
                ),
                "the file is damaged: export it again",
            ));
        }
        mesh.face_sizes.extend_from_slice(&faces.sizes);
        mesh.face_vertices.extend_from_slice(&faces.vertices);
        // A mirror turns the faces round.
        if world.matrix3.determinant() < 0.0 {
            turn_round(&mut mesh.face_vertices, &faces.sizes);
        }
        Ok(())
    }

    /// The numbers that its writer has put beside its points by a name, at a time: one for each.
    ///
    /// # Errors
    /// A name that is not there, a property of another type, or damage.
    pub(super) fn vertex_values(
        &self,
        name: &str,
        time_s: f64,
        archive: &Archive,
        values: &mut Vec<f32>,
    ) -> Outcome<()> {
        values.clear();
        let missing = || {
            let names = self.arbitrary.as_ref().map_or(Vec::new(), Compound::names);
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            Fault::new(
                format!("its vertices have no {name:?}; of such numbers there are: {known}"),
                "export it again with the attribute, or name another",
            )
        };
        let arbitrary = self.arbitrary.as_ref().ok_or_else(missing)?;
        // What is named many times over is written once, with an index for each.
        let indexed = arbitrary.compound(name, archive, &mut Allowance::new(INDEXED, "reading"))?;
        let property = |name| indexed.as_ref().map_or(Ok(None), |indexed| indexed.property(name, archive));
        let (numbers, indices) = match property(".vals")? {
            Some(numbers) => (Some(numbers), property(".indices")?),
            None => (arbitrary.property(name, archive)?, None),
        };
        let numbers = numbers.filter(|numbers| !numbers.is_empty()).ok_or_else(missing)?;
        let bracket = numbers.bracket(time_s);
        let at = |index: u32| -> Outcome<Vec<f32>> {
            let lengths = numbers.lengths(numbers.stored(index), &archive.ogawa)?;
            let Some(indices) = &indices else { return Ok(lengths) };
            let places = indices.indices(indices.stored(index), &archive.ogawa)?;
            let length = |place: u32| lengths.get(place as usize).copied();
            places.into_iter().map(length).collect::<Option<_>>().ok_or_else(|| {
                Fault::new(
                    format!("the indices of {name:?} name numbers that are not there"),
                    "the file is damaged: export it again",
                )
            })
        };
        values.extend(at(bracket.floor)?);
        if bracket.ceiling != bracket.floor {
            let after = at(bracket.ceiling)?;
            if after.len() == values.len() {
                let mix = |a: f32, b: f32| f64::from(a) + (f64::from(b) - f64::from(a)) * bracket.fraction;
                values.iter_mut().zip(after).for_each(|(a, b)| *a = mix(*a, b) as f32);
            }
        }
        Ok(())
    }

    fn points(&self, property: &Property, stored: u32, ogawa: &Ogawa) -> Outcome<Arc<Vec<[f32; 3]>>> {
        self.point_cache.get(
            stored,
            || property.points(stored, ogawa),
            |points| size_of_val(points.as_slice()) as u64,
        )
    }

    fn faces(&self, time_s: f64, ogawa: &Ogawa) -> Outcome<Arc<Faces>> {
        let stored = |property: &Option<Property>| {
            property.as_ref().map_or(0, |property| property.stored(property.bracket(time_s).floor))
        };
        let key = (stored(&self.indices), stored(&self.counts));
        let read = || {
            let list = |property: &Option<Property>, stored| {
                property.as_ref().map_or(Ok(Vec::new()), |property| property.indices(stored, ogawa))
            };
            let (mut vertices, sizes) = (list(&self.indices, key.0)?, list(&self.counts, key.1)?);
            let total: u64 = sizes.iter().map(|size| u64::from(*size)).sum();
            if total != vertices.len() as u64 {
                return Err(Fault::new(
                    format!("the faces count {total} corners, but {} are listed", vertices.len()),
                    "the file is damaged: export it again",
                ));
            }
            let vertices_needed = vertices.iter().max().map_or(0, |index| *index as usize + 1);
            // Alembic winds faces clockwise and the house counter-clockwise.
            turn_round(&mut vertices, &sizes);
            Ok(Faces { vertices, sizes, vertices_needed })
        };
        let bytes = |faces: &Faces| 4 * (faces.vertices.len() + faces.sizes.len()) as u64;
        self.face_cache.get(key, read, bytes)
    }
}

/// Gives each face the other side; `sizes` add up to the number of vertices.
fn turn_round(vertices: &mut [u32], sizes: &[u32]) {
    let mut rest = vertices;
    for &size in sizes {
        let Some((face, others)) = rest.split_at_mut_checked(size as usize) else { return };
        face.reverse();
        rest = others;
    }
}
