//! Values of attributes, turned from the many types USD has into the few that are used here.

use glam::{DMat4, DQuat};
use openusd::sdf::Value;

/// Points or vectors.
pub(super) fn points(value: Value) -> Option<Vec<[f32; 3]>> {
    Some(match value {
        Value::Vec3fVec(list) => list.iter().map(|v| [v.x, v.y, v.z]).collect(),
        Value::Vec3dVec(list) => list.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32]).collect(),
        Value::Vec3hVec(list) => list.iter().map(|v| [v.x.to_f32(), v.y.to_f32(), v.z.to_f32()]).collect(),
        _ => return None,
    })
}

/// Indices or counts; nothing where one is negative.
pub(super) fn indices(value: Value) -> Option<Vec<u32>> {
    match value {
        Value::IntVec(list) => list.into_iter().map(|i| u32::try_from(i).ok()).collect(),
        Value::UintVec(list) => Some(list),
        _ => None,
    }
}

/// Weights.
pub(super) fn floats(value: Value) -> Option<Vec<f32>> {
    Some(match value {
        Value::FloatVec(list) => list,
        Value::DoubleVec(list) => list.into_iter().map(|v| v as f32).collect(),
        Value::HalfVec(list) => list.into_iter().map(|v| v.to_f32()).collect(),
        _ => return None,
    })
}

/// Names.
pub(super) fn tokens(value: Value) -> Option<Vec<String>> {
    match value {
        Value::TokenVec(list) => Some(list.iter().map(|token| token.as_str().to_owned()).collect()),
        Value::StringVec(list) => Some(list),
        _ => None,
    }
}

/// One name.
pub(super) fn token(value: Value) -> Option<String> {
    match value {
        Value::Token(token) => Some(token.as_str().to_owned()),
        Value::String(text) => Some(text),
        _ => None,
    }
}

/// Matrices: rows for row vectors are columns for column vectors.
pub(super) fn matrices(value: Value) -> Option<Vec<DMat4>> {
    match value {
        Value::Matrix4dVec(list) => Some(list.iter().map(|m| DMat4::from_cols_array(&m.0)).collect()),
        _ => None,
    }
}

/// One matrix.
pub(super) fn matrix(value: Value) -> Option<DMat4> {
    match value {
        Value::Matrix4d(m) => Some(DMat4::from_cols_array(&m.0)),
        _ => None,
    }
}

/// Rotations; of length 1 where they have a length at all.
pub(super) fn rotations(value: Value) -> Option<Vec<DQuat>> {
    Some(match value {
        Value::QuatfVec(list) => {
            list.iter().map(|q| quaternion([q.w, q.x, q.y, q.z].map(f64::from))).collect()
        }
        Value::QuatdVec(list) => list.iter().map(|q| quaternion([q.w, q.x, q.y, q.z])).collect(),
        Value::QuathVec(list) => {
            list.iter().map(|q| quaternion([q.w, q.x, q.y, q.z].map(|c| f64::from(c.to_f32())))).collect()
        }
        _ => return None,
    })
}

/// From the real part and the three others.
pub(super) fn quaternion([w, x, y, z]: [f64; 4]) -> DQuat {
    let rotation = DQuat::from_xyzw(x, y, z, w);
    // Of no length: no rotation. What is not a number stays so.
    if rotation.length_squared() == 0.0 { DQuat::IDENTITY } else { rotation.normalize() }
}

/// The numbers of a transform's operation: one, three, four (a quaternion, real part first) or sixteen.
pub(super) fn numbers(value: Value) -> Option<Vec<f64>> {
    Some(match value {
        Value::Float(v) => vec![f64::from(v)],
        Value::Double(v) => vec![v],
        Value::Half(v) => vec![f64::from(v.to_f32())],
        Value::Int(v) => vec![f64::from(v)],
        // In samples of text layers a whole number is read so, whatever the attribute's type.
        Value::Int64(v) => vec![v as f64],
        Value::Vec3f(v) => [v.x, v.y, v.z].map(f64::from).to_vec(),
        Value::Vec3d(v) => vec![v.x, v.y, v.z],
        Value::Vec3h(v) => [v.x, v.y, v.z].map(|c| f64::from(c.to_f32())).to_vec(),
        Value::Quatf(q) => [q.w, q.x, q.y, q.z].map(f64::from).to_vec(),
        Value::Quatd(q) => vec![q.w, q.x, q.y, q.z],
        Value::Quath(q) => [q.w, q.x, q.y, q.z].map(|c| f64::from(c.to_f32())).to_vec(),
        Value::Matrix4d(m) => m.0.to_vec(),
        _ => return None,
    })
}

/// About how much a value takes in memory.
pub(super) fn bytes(value: &Value) -> u64 {
    let bytes = match value {
        Value::Vec3fVec(list) => size_of_val(list.as_slice()),
        Value::Vec3dVec(list) => size_of_val(list.as_slice()),
        Value::Vec3hVec(list) => size_of_val(list.as_slice()) * 2,
        Value::IntVec(list) => size_of_val(list.as_slice()),
        Value::FloatVec(list) => size_of_val(list.as_slice()),
        Value::DoubleVec(list) => size_of_val(list.as_slice()),
        Value::HalfVec(list) => size_of_val(list.as_slice()) * 2,
        Value::TokenVec(list) => list.iter().map(|token| token.as_str().len() + 24).sum(),
        Value::Matrix4dVec(list) => size_of_val(list.as_slice()),
        Value::QuatfVec(list) => size_of_val(list.as_slice()) * 2,
        Value::QuatdVec(list) => size_of_val(list.as_slice()),
        Value::QuathVec(list) => size_of_val(list.as_slice()) * 4,
        _ => 0,
    };
    bytes as u64 + 160
}
