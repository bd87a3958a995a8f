//! Geometry that knows nothing of cages or skeletons.

pub mod bvh;
pub mod collision;
pub mod convex_hull;
pub mod decimate;
pub mod distance;
pub mod inside;
pub mod intersections;
pub mod predicates;
