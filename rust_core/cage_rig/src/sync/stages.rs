//! The stages of a bind, as long on its bar as they take.
//!
//! Estimates in nanoseconds of one thread, measured by `benches/binding.rs`; only their ratios count.

use super::bind::BindInput;
use crate::progress::{Cancelled, Part, Progress};

/// Parts of the bar, in the order in which they come.
#[derive(Debug, Clone, Copy)]
pub struct Stages<'a> {
    pub(super) coordinates: Part<'a>,
    pub(super) reach: Part<'a>,
    pub(super) anchors: Part<'a>,
    pub(super) joints: Part<'a>,
    pub(super) posed_cage: Part<'a>,
    pub(super) frame: Part<'a>,
    pub(super) surroundings: Part<'a>,
    pub(super) centers: Part<'a>,
}

impl<'a> Stages<'a> {
    /// Of binding `input`; what is known takes no time.
    pub fn new(input: &BindInput, progress: &'a Progress) -> Self {
        let count = |n: usize| n as f64;
        let (skin, corners) = (count(input.skin_vertices.len()), count(input.skin_faces.corners.len()));
        let (cage, faces) = (count(input.cage.vertices().len()), count(input.cage.triangles().len()));
        let (joints, known) = (count(input.skeleton.len()), &input.known);
        let unless = |known: bool, cost: f64| if known { 0.0 } else { cost };
        let no_centers = !input.method.centers || known.center_coords.is_some();
        let [coordinates, reach, anchors, joints, posed_cage, frame, surroundings, centers] =
            progress.whole().split([
                unless(known.cage_coords.is_some(), 25.0 * skin * faces),
                4.0 * skin * faces,
                unless(known.anchors.is_some(), 25.0 * skin * cage),
                unless(known.joint_coords.is_some(), 19.0 * joints * corners),
                20.0 * cage.powi(3),
                20.0 * skin * cage,
                5.0 * skin * joints,
                unless(no_centers, 600.0 * skin * cage),
            ]);
        Self { coordinates, reach, anchors, joints, posed_cage, frame, surroundings, centers }
    }

    /// All are done.
    pub fn end(&self) -> Result<(), Cancelled> {
        self.centers.reach(1.0)
    }
}
