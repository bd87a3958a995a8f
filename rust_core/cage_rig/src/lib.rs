//! Coupled cages and skeletons.
//!
//! A character carries a deformation *cage* and an *armature*; editing either updates the other.
//! [`sync::CoupledRig`] owns that cycle. Around it stand two families: [`coordinates`], which say
//! how the cage moves the skin, and [`skinning`], which say how the bones move it.
//!
//! Based on [CTL*20]: Corda, Thiery, Livesu, Puppo, Boubekeur, Scateni, *Real-Time Deformation
//! with Coupled Cages and Skeletons*, Computer Graphics Forum 39(6), 2020. Equation numbers in
//! the code are that paper's.
//!
//! Matrices are written by what is moved (rows) and what moves it (columns); `#V by 3` is a list
//! of points. Binding, joints and solves are `f64`; what is touched every frame is `f32`.

#![allow(rustdoc::broken_intra_doc_links)] // [CTL*20] and its like are citations

pub mod bones;
mod cage;
pub mod caging;
pub mod coordinates;
mod error;
mod geometry;
mod linalg;
mod mesh;
mod panels;
mod points;
mod progress;
mod rows;
pub mod simd;
mod skeleton;
pub mod skinning;
pub mod sync;
mod threads;
mod weights;

#[cfg(test)]
extern crate self as cage_rig;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
pub(crate) mod fixtures;

pub use cage::Cage;
pub use error::{CageError, CagingError, Error, PoseError, SkeletonError, SkinError, WeightsError};
pub use mesh::Polygons;
pub use panels::Precision;
pub use points::{bounding_diagonal, Matrix3, Point, Transform, LARGEST};
pub use progress::{unwatched, Cancelled, Part, Progress, Stage};
pub use rows::Rows;
pub use skeleton::Skeleton;
pub use sync::CoupledRig;
pub use weights::SkinWeights;
