//! Geometry that knows nothing of cages or skeletons.

pub mod distance;
pub mod inside;
