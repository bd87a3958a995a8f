//! What a frame makes of the three large arrays, when they are read and due.
//!
//! Everything that it works with stays from frame to frame: after the first one none allocates, but
//! for the columns of a drag that begins, the shapes of a cage that is keyed, and what the thread pool keeps of its jobs.

use super::bake_frames::Ahead;
use super::cage_updater::FitScratch;
use super::passes::{Kept, Pass};
use super::skeleton_updater::JointMotion;
use super::CoupledRig;
use crate::points::Point;
use crate::skinning::{Scratch, SkinningInput};

/// What frames work with.
#[derive(Debug, Clone, Default)]
pub(super) struct Buffers {
    pub(super) kept: Kept,
    /// Those last read, or those before the present ones.
    pub(super) motions: Vec<JointMotion>,
    pub(super) ahead: Ahead,
    pub(super) bones: Scratch,
    fit: FitScratch,
    cage: Vec<Point>,
}

impl Buffers {
    /// For a rig at rest in `cage` (C₀, `#C by 3`).
    pub(super) fn new(cage: &[Point]) -> Self {
        Self { kept: Kept::new(cage), ..Self::default() }
    }
}

impl CoupledRig {
    /// Rest skin M, `#M by 3`.
    pub fn rest_skin(&mut self) -> &[[f32; 3]] {
        if self.stale.rest_skin {
            let Self { binding, rest_cage, ground, buffers, rest_skin, .. } = self;
            let confines = ground.confines(binding);
            let pass = buffers.kept.pass(&binding.rest_skin, rest_cage, &confines, rest_skin);
            self.work.rest_passes += 1;
            self.work.rest_column_passes += usize::from(pass == Pass::Columns);
            self.work.rest_shape_passes += usize::from(pass == Pass::Shapes);
            self.stale.rest_skin = false;
        }
        &self.rest_skin
    }

    /// Posed skin M′, `#M by 3`.
    pub fn posed_skin(&mut self) -> &[[f32; 3]] {
        if self.stale.posed_skin {
            let mut posed = std::mem::take(&mut self.posed_skin);
            self.pose_into(&mut posed);
            self.posed_skin = posed;
            self.stale.posed_skin = false;
        }
        &self.posed_skin
    }

    /// Writes the posed skin M′ into `posed` (`#M by 3`) and keeps none: a frame that is shown elsewhere is
    /// made there.
    pub fn posed_skin_into(&mut self, posed: &mut [[f32; 3]]) {
        if self.stale.posed_skin {
            self.pose_into(posed);
        } else {
            posed.copy_from_slice(&self.posed_skin);
        }
    }

    fn pose_into(&mut self, posed: &mut [[f32; 3]]) {
        self.rest_skin();
        let needed = self.centers.as_mut().filter(|_| self.method.centers);
        let centers = needed.map_or(&[][..], |centers| {
            let pass = centers.update(&self.rest_cage, &self.ground.confines(&self.binding));
            self.work.center_passes += usize::from(pass.is_some());
            self.work.center_column_passes += usize::from(pass == Some(Pass::Columns));
            self.work.center_shape_passes += usize::from(pass == Some(Pass::Shapes));
            centers.centers()
        });
        let (path, weights) = (self.binding.path, &self.binding.frame_weights);
        let (transforms, rest_skin) = (&self.transforms, &self.rest_skin);
        let input = SkinningInput { path, transforms, weights, rest_skin, centers };
        (self.method.pose)(&input, &mut self.buffers.bones, posed);
        self.work.skin_passes += 1;
    }

    /// Posed cage C′, `#C by 3`.
    pub fn posed_cage(&mut self) -> &[Point] {
        if self.stale.posed_cage {
            let Buffers { fit, cage, .. } = &mut self.buffers;
            self.ground.cage_into(&self.rest_cage, cage);
            let updater = &self.binding.cage_updater;
            updater.posed_cage_into(cage, &self.transforms, fit, &mut self.posed_cage);
            self.work.cage_fits += 1;
            self.stale.posed_cage = false;
        }
        &self.posed_cage
    }
}
