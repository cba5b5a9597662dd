//! Cloth
pub mod curvature;
mod geodesic;
pub mod proximity;
#[cfg(test)]
mod shapes;
mod tree;
mod triangle;
pub mod triangulation;
