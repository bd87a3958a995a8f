//! Bones as matrices, at rest and posed: how an animation has them, and how the refit skeleton's are shown.
//!
//! T_j = posed_j · rest_j⁻¹. A refit bone keeps the animation's orientation, with its head at the refit
//! joint; one whose tail was another bone's head is stretched along itself to reach that one's joint.

use crate::points::{Point, Transform};

/// How near to rest a bone is taken to be there, so that nothing moves what no bone moves: rounding
/// of single precision.
const STILL: f64 = 1e-7;
/// A bone is never shown shorter than this part of its length.
const SHORTEST: f64 = 0.05;

/// Rest matrices of `#J` bones, with their inverses.
#[derive(Debug, Clone)]
pub struct Bones {
    rest: Vec<Transform>,
    inverse: Vec<Transform>,
    links: Vec<TailLink>,
}

/// That a bone's tail was a child's head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TailLink {
    /// The bone.
    pub bone: usize,
    /// The bone at whose head it ended.
    pub child: usize,
    /// Its length then.
    pub length: f64,
}

impl Bones {
    /// Keeps `rest` (`#J`, in rig space); `links` say which tails follow a joint when these bones are
    /// posed as the refit skeleton.
    pub fn new(rest: Vec<Transform>, links: Vec<TailLink>) -> Self {
        let inverse = rest.iter().map(Transform::inverse).collect();
        Self { rest, inverse, links }
    }

    /// The joints: where the bones begin.
    pub fn heads(&self) -> Vec<Point> {
        self.rest.iter().map(|rest| rest.translation).collect()
    }

    /// T of bones `posed` (`#J`): the identity, to the last bit, where a bone rests.
    pub fn transforms(&self, posed: &[Transform]) -> Vec<Transform> {
        let transform = |((posed, rest), inverse): ((&Transform, &Transform), &Transform)| {
            let off = (posed.linear - rest.linear).amax().max((posed.translation - rest.translation).amax());
            if off <= STILL {
                Transform::identity()
            } else {
                posed.after(inverse)
            }
        };
        posed.iter().zip(&self.rest).zip(&self.inverse).map(transform).collect()
    }

    /// What poses these bones as the refit skeleton, each in its own rest space (`#J`), from refit
    /// `transforms` and `joints`.
    pub fn refit(&self, transforms: &[Transform], joints: &[Point]) -> Vec<Transform> {
        let mut moved = self.rest.clone();
        for (bone, joint) in moved.iter_mut().zip(joints) {
            bone.translation = *joint;
        }
        for link in &self.links {
            let along = self.rest[link.bone].linear.column(1);
            let reach = (joints[link.child] - joints[link.bone]).dot(&along) / link.length;
            let mut stretched = moved[link.bone].linear.column_mut(1);
            stretched *= reach.max(SHORTEST);
        }
        let poses = moved.iter().zip(transforms).zip(&self.inverse);
        poses.map(|((moved, transform), inverse)| inverse.after(&transform.after(moved))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::Matrix3;

    /// Two bones along x, the second at the end of the first; their y runs along them.
    fn arm() -> Bones {
        let links = vec![TailLink { bone: 0, child: 1, length: 1.0 }];
        let linear = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0).transpose();
        Bones::new(
            [-1.0, 0.0].map(|x| Transform { linear, translation: Point::new(x, 0.0, 0.0) }).to_vec(),
            links,
        )
    }

    #[test]
    fn bones_at_rest_move_nothing_and_posed_ones_go_where_they_are() {
        let arm = arm();
        let mut posed = arm.rest.clone();
        posed[0].translation.x += 1e-8;
        posed[1] = Transform { linear: Matrix3::identity() * 2.0, translation: Point::new(0.5, 1.0, 0.0) };
        let transforms = arm.transforms(&posed);
        assert_eq!(transforms[0], Transform::identity());
        let again = transforms[1].after(&arm.rest[1]);
        assert!((again.linear - posed[1].linear).amax() < 1e-15);
        assert!((again.translation - posed[1].translation).amax() < 1e-15);
    }

    #[test]
    fn a_refit_bone_reaches_its_child() {
        let arm = arm();
        let joints = [Point::new(-1.5, 0.0, 0.0), Point::zeros()];
        let still = [Transform::identity(); 2];
        let basis = arm.refit(&still, &joints);
        let shown = arm.rest[0].after(&basis[0]);
        assert!((shown.apply(&Point::new(0.0, 1.0, 0.0)) - joints[1]).amax() < 1e-15);
        assert!((shown.translation - joints[0]).amax() < 1e-15);
    }

    #[test]
    fn a_bone_without_volume_stays_a_number() {
        let flat = Transform { linear: Matrix3::zeros(), translation: Point::new(1.0, 0.0, 0.0) };
        let found = Bones::new(vec![flat], Vec::new()).transforms(&[Transform::identity()]);
        assert!(found[0].is_usable());
    }
}
