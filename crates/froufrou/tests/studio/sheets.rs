//! A cloth and a sheet of paper that move as a formula says, for who tells an engine of their vertices.

/// Cells along a side of sheets.
pub const CELLS: usize = 12;

/// Where a vertex of the cloth is: it is dragged over the floor and waves.
pub fn linen(time_s: f64, [x, z]: [f64; 2]) -> [f64; 3] {
    [x + 0.5 * time_s, 0.01 + 0.03 * (1.0 + (9.0 * x + 14.0 * time_s).sin()), z]
}

/// Where one of the sheet of paper is: it is pulled flat, and snaps through now and then.
pub fn letter(time_s: f64, [x, z]: [f64; 2]) -> [f64; 3] {
    let angle = 1.2 * (((time_s - 0.3) * 5.0).sin() * 8.0).clamp(-1.0, 1.0) + 1e-3;
    let radius = 0.2 / angle;
    let height = radius * ((angle * x).cos() - (angle / 2.0).cos());
    [radius * (angle * x).sin(), 0.6 + height, 1.5 + 0.2 * z]
}

/// The vertices of a sheet.
pub fn vertices(time_s: f64, place: fn(f64, [f64; 2]) -> [f64; 3]) -> Vec<[f32; 3]> {
    let along = |n: usize| n as f64 / CELLS as f64 - 0.5;
    let side = CELLS + 1;
    let corner = |i: usize| [along(i % side), along(i / side)];
    (0..side * side).map(|i| place(time_s, corner(i)).map(|c| c as f32)).collect()
}
