//! SkelUp: the cage at rest moves the joints, and the transforms follow.
//!
//! Based on [CTL*20] §4.1–4.2. Joints: a = Ψ C, Eq. (13). Transforms: joint j stays attached to its
//! parent, Eq. (16–17). Cost: `#J · #C` and `#J`.
//!
//! The paper keeps only the rotation of each bone. We keep its linear part R_j and the step
//! d_j = T_j(a_j) − T_parent(a_j) that the animation makes at the joint, so that root motion,
//! stretch and constraints live on; with d_j = 0 the two are the same.

use crate::points::{Matrix3, Point, Transform};
use crate::rows::Rows;
use crate::skeleton::Skeleton;

/// What the animation says of one bone, whatever the rest skeleton.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion {
    /// R_j.
    pub linear: Matrix3,
    /// d_j: the step of the joint against its parent, or of a root against its rest place.
    pub step: Point,
}

/// Ψ and the hierarchy.
#[derive(Debug, Clone)]
pub struct SkeletonUpdater {
    skeleton: Skeleton,
    joint_coords: Rows,
}

impl SkeletonUpdater {
    /// Keeps the skeleton of the bind and Ψ (`#J by #C`).
    pub fn new(skeleton: Skeleton, joint_coords: Rows) -> Self {
        Self { skeleton, joint_coords }
    }

    /// The skeleton of the bind.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// Ψ.
    pub fn joint_coords(&self) -> &Rows {
        &self.joint_coords
    }

    /// Writes rest joints a = Ψ C of `cage` (C, `#C by 3`), Eq. (13), of whose movement joint j takes part
    /// by `shares[j]`.
    pub fn joints_into(&self, cage: &[Point], shares: &[f64], joints: &mut Vec<Point>) {
        let bound = self.skeleton.joints();
        self.joint_coords.times_into(cage, joints);
        for ((joint, bound), &share) in
            joints.iter_mut().zip(bound).zip(shares).filter(|(_, share)| **share != 1.0)
        {
            *joint = bound + (*joint - bound) * share;
        }
    }

    /// Reads R_j and d_j from `transforms` measured at `rest_joints` (`#J by 3`).
    pub fn motions_into(
        &self,
        transforms: &[Transform],
        rest_joints: &[Point],
        motions: &mut Vec<JointMotion>,
    ) {
        let step = |j: usize| {
            let place = rest_joints[j];
            let carried = self.skeleton.parent(j).map_or(place, |parent| transforms[parent].apply(&place));
            transforms[j].apply(&place) - carried
        };
        motions.clear();
        motions.extend(
            (0..transforms.len()).map(|j| JointMotion { linear: transforms[j].linear, step: step(j) }),
        );
    }

    /// Transforms T′ of `motions` on a skeleton whose joints rest at `joints`, Eq. (16–17):
    /// t′_j = T′_parent(a_j) + d_j − R_j a_j, and for a root t′_j = a_j + d_j − R_j a_j.
    pub fn transforms_into(
        &self,
        motions: &[JointMotion],
        joints: &[Point],
        transforms: &mut Vec<Transform>,
    ) {
        transforms.resize(motions.len(), Transform::identity());
        for &j in self.skeleton.parents_first() {
            let place = joints[j];
            let carried = self.skeleton.parent(j).map_or(place, |parent| transforms[parent].apply(&place));
            let JointMotion { linear, step } = motions[j];
            transforms[j] = Transform { linear, translation: carried + step - linear * place };
        }
    }

    /// The same, fresh.
    pub fn transforms(&self, motions: &[JointMotion], joints: &[Point]) -> Vec<Transform> {
        let mut transforms = Vec::new();
        self.transforms_into(motions, joints, &mut transforms);
        transforms
    }

    /// ∂t_j/∂c_k for every cage vertex k, as 3 by 3 blocks, `#J by #C`: the rows of
    /// B_topo⁻¹ A_R Ψ, Eq. (18), walked down the hierarchy instead of inverted:
    /// ∂t_j = ∂t_parent + (R_parent − R_j) ∂a_j, and for a root ∂t_j = (I − R_j) ∂a_j. Joint j takes
    /// part in the cage's movement by `shares[j]`.
    pub fn translation_gradient(&self, linear: &[Matrix3], shares: &[f64]) -> Vec<Vec<Matrix3>> {
        let columns = self.joint_coords.columns();
        let mut gradient = vec![Vec::new(); linear.len()];
        for &j in self.skeleton.parents_first() {
            let (above, turn) = match self.skeleton.parent(j) {
                Some(parent) => (gradient[parent].clone(), linear[parent] - linear[j]),
                None => (vec![Matrix3::zeros(); columns], Matrix3::identity() - linear[j]),
            };
            let row = above.iter().zip(self.joint_coords.row(j));
            gradient[j] = row.map(|(above, psi)| above + turn * (shares[j] * psi)).collect();
        }
        gradient
    }
}
