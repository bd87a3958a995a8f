//! Frames that are known in advance, as in a bake: Φ is read once for four of them.
//!
//! What [`CoupledRig::play`] and [`CoupledRig::posed_skin`] make of each frame, to the last bit where
//! they read Φ whole, without touching the rig's own cage and pose.

use super::skeleton_updater::JointMotion;
use super::CoupledRig;
use crate::error::PoseError;
use crate::panels::{Steps, FRAMES};
use crate::points::{Point, Transform};
use crate::skinning::SkinningInput;

/// Rest cage (`#C by 3`) and transforms (one per joint) of a frame.
pub type Frame<'a> = (&'a [Point], &'a [Transform]);

/// What such frames work with.
#[derive(Debug, Clone, Default)]
pub(super) struct Ahead {
    skins: Vec<[f32; 3]>,
    centers: Vec<[f32; 3]>,
    steps: Steps,
    motions: Vec<JointMotion>,
    joints: Vec<Point>,
    transforms: Vec<Transform>,
}

impl CoupledRig {
    /// Writes the posed skins of `frames` into `posed` (`#frames · #M by 3`, frame by frame).
    /// `rest_joints`: what the transforms were measured at, as in [`Self::pose`].
    pub fn posed_skins(
        &mut self,
        frames: &[Frame],
        rest_joints: Option<&[Point]>,
        posed: &mut [[f32; 3]],
    ) -> Result<(), PoseError> {
        let count = self.rest_skin.len();
        if posed.len() != frames.len() * count {
            return Err(PoseError::FrameRows { expected: frames.len() * count, found: posed.len() });
        }
        for (cage, transforms) in frames {
            self.check_cage(cage)?;
            self.check_transforms(transforms, rest_joints)?;
        }
        let mut ahead = std::mem::take(&mut self.buffers.ahead);
        let mut still = None;
        for (group, posed) in frames.chunks(FRAMES).zip(posed.chunks_mut(FRAMES * count)) {
            let first = group[0].0;
            let alike = group.iter().all(|(cage, _)| *cage == first);
            if !alike || still != Some(first) {
                self.rest_ahead(if alike { &group[..1] } else { group }, &mut ahead);
            }
            still = alike.then_some(first);
            for (f, (frame, posed)) in group.iter().zip(posed.chunks_mut(count)).enumerate() {
                self.pose_ahead(frame, rest_joints, if alike { 0 } else { f }, &mut ahead, posed);
            }
        }
        self.buffers.ahead = ahead;
        Ok(())
    }

    /// Rest skins, and centers where the method turns about them, of one to four frames.
    fn rest_ahead(&mut self, group: &[Frame], ahead: &mut Ahead) {
        let (count, confines) = (self.rest_skin.len(), self.ground.confines(&self.binding));
        let cages: Vec<&[Point]> = group.iter().map(|(cage, _)| *cage).collect();
        ahead.skins.resize(FRAMES * count, [0.0; 3]);
        self.binding.rest_skin.write_frames(&cages, &confines, &mut ahead.steps, &mut ahead.skins);
        self.work.rest_passes += 1;
        if let Some(centers) = self.centers.as_ref().filter(|_| self.method.centers) {
            ahead.centers.resize(FRAMES * count, [0.0; 3]);
            centers.mover().write_frames(&cages, &confines, &mut ahead.steps, &mut ahead.centers);
            self.work.center_passes += 1;
        }
    }

    /// The posed skin of `frame` from rest skin number `rest`.
    fn pose_ahead(
        &mut self,
        (cage, transforms): &Frame,
        rest_joints: Option<&[Point]>,
        rest: usize,
        ahead: &mut Ahead,
        posed: &mut [[f32; 3]],
    ) {
        let Ahead { skins, centers, motions, joints, transforms: refit, .. } = ahead;
        let (count, updater) = (posed.len(), &self.binding.skeleton_updater);
        let measured_at = rest_joints.unwrap_or(updater.skeleton().joints());
        updater.motions_into(transforms, measured_at, motions);
        self.ground.joints_into(&self.binding, cage, joints);
        updater.transforms_into(motions, joints, refit);
        let of = rest * count..(rest + 1) * count;
        let input = SkinningInput {
            path: self.binding.path,
            transforms: refit,
            weights: &self.binding.frame_weights,
            rest_skin: &skins[of.clone()],
            centers: if self.method.centers { &centers[of] } else { &[] },
        };
        (self.method.pose)(&input, &mut self.buffers.bones, posed);
        self.work.skin_passes += 1;
    }
}
