//! The skeleton: joints at rest and who hangs on whom.

use crate::error::SkeletonError;
use crate::points::{first_unusable, Point};

/// Joints (`#J by 3`, rig space) and their hierarchy. Parents may come in any order.
#[derive(Debug, Clone)]
pub struct Skeleton {
    joints: Vec<Point>,
    parents: Vec<Option<usize>>,
    order: Vec<usize>,
}

impl Skeleton {
    /// Checks `parents` (one per joint, −1 marks a root; several roots are fine) and orders the
    /// joints parents first.
    pub fn new(joints: Vec<Point>, parents: &[i64]) -> Result<Self, SkeletonError> {
        let count = joints.len();
        if count == 0 {
            return Err(SkeletonError::Empty);
        }
        if parents.len() != count {
            return Err(SkeletonError::ParentCount { joints: count, parents: parents.len() });
        }
        if let Some(joint) = first_unusable(&joints) {
            return Err(SkeletonError::NotFinite { joint });
        }
        let checked: Vec<Option<usize>> = parents
            .iter()
            .enumerate()
            .map(|(joint, &parent)| match usize::try_from(parent) {
                Ok(index) if index < count => Ok(Some(index)),
                _ if parent == -1 => Ok(None),
                _ => Err(SkeletonError::BadParent { joint, parent, joints: count }),
            })
            .collect::<Result<_, _>>()?;
        let order = parents_first(&checked)?;
        Ok(Self { joints, parents: checked, order })
    }

    /// Number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// True without joints (which `new` refuses).
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Rest joints a₀ of the bind, `#J by 3`.
    pub fn joints(&self) -> &[Point] {
        &self.joints
    }

    /// The parent of `joint`, `None` for a root.
    pub fn parent(&self, joint: usize) -> Option<usize> {
        self.parents[joint]
    }

    /// Whether each joint is `joint` or hangs on it.
    pub(crate) fn below(&self, joint: usize) -> Vec<bool> {
        let mut below = vec![false; self.len()];
        for &j in self.parents_first() {
            below[j] = j == joint || self.parent(j).is_some_and(|parent| below[parent]);
        }
        below
    }

    /// Every joint once, each after its parent.
    pub fn parents_first(&self) -> &[usize] {
        &self.order
    }
}

fn parents_first(parents: &[Option<usize>]) -> Result<Vec<usize>, SkeletonError> {
    let mut children = vec![Vec::new(); parents.len()];
    let mut order = Vec::with_capacity(parents.len());
    for (joint, parent) in parents.iter().enumerate() {
        match parent {
            Some(parent) => children[*parent].push(joint),
            None => order.push(joint),
        }
    }
    let mut next = 0;
    while let Some(&joint) = order.get(next) {
        order.extend_from_slice(&children[joint]);
        next += 1;
    }
    if order.len() == parents.len() {
        return Ok(order);
    }
    // What no root reaches hangs on a cycle: walking up from it ends on the cycle itself.
    let mut reached = vec![false; parents.len()];
    order.iter().for_each(|&j| reached[j] = true);
    let mut joint = reached.iter().position(|r| !r).unwrap_or(0);
    for _ in 0..parents.len() {
        joint = parents[joint].unwrap_or(joint);
    }
    Err(SkeletonError::Cycle { joint })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skeleton(parents: &[i64]) -> Result<Skeleton, SkeletonError> {
        Skeleton::new(vec![Point::zeros(); parents.len()], parents)
    }

    #[test]
    fn every_joint_comes_after_its_parent() {
        let skeleton = skeleton(&[3, -1, 0, 1, -1, 4]).expect("a forest in any order");
        let place = |j: usize| skeleton.parents_first().iter().position(|&k| k == j);
        for joint in 0..6 {
            assert!(skeleton.parent(joint).is_none_or(|p| place(p) < place(joint)));
        }
    }

    #[test]
    fn a_cycle_is_refused_by_a_joint_on_it() {
        assert!(matches!(skeleton(&[-1, 0, 4, 2, 3, 2]), Err(SkeletonError::Cycle { joint: 2..=4 })));
    }

    #[test]
    fn bad_parents_are_refused_by_joint() {
        assert_eq!(
            skeleton(&[-1, 2]).err(),
            Some(SkeletonError::BadParent { joint: 1, parent: 2, joints: 2 })
        );
        assert_eq!(skeleton(&[-2]).err(), Some(SkeletonError::BadParent { joint: 0, parent: -2, joints: 1 }));
        assert_eq!(skeleton(&[]).err(), Some(SkeletonError::Empty));
        assert_eq!(
            Skeleton::new(vec![Point::zeros()], &[-1, 0]).err(),
            Some(SkeletonError::ParentCount { joints: 1, parents: 2 })
        );
        let nan = Skeleton::new(vec![Point::zeros(), Point::new(0.0, f64::NAN, 0.0)], &[-1, 0]);
        assert_eq!(nan.err(), Some(SkeletonError::NotFinite { joint: 1 }));
    }
}
