//! An edit of the posed cage, carried back to the rest cage until it is posed as wanted.

use super::cage_reverser::CageReverser;
use super::cage_updater::CageUpdater;
use super::skeleton_updater::SkeletonUpdater;
use super::{Binding, CoupledRig};
use crate::error::PoseError;
use crate::points::{bounding_diagonal, Matrix3, Point};

/// A posed cage edit has arrived when it misses by this part of the size.
const ARRIVED: f64 = 1e-12;
/// An edit that ends farther away than this is refused.
const REACHED: f64 = 1e-10;
/// Solves an edit may take: one, and refinements where Eq. (19) is badly conditioned.
const SOLVES: usize = 4;

/// [`CageReverser::new`] or [`CageReverser::dense`].
type Make = fn(&CageUpdater, &SkeletonUpdater, &[Matrix3], &[f64]) -> Result<CageReverser, PoseError>;

impl CoupledRig {
    /// The rest cage whose posed cage is `wanted`. Changes nothing but the kept factors.
    pub(super) fn reverse(&mut self, wanted: &[Point]) -> Result<Vec<Point>, PoseError> {
        let reverser = match self.reverser.take() {
            Some(reverser) => reverser,
            None => self.factors(CageReverser::new)?,
        };
        let (mut cage, mut miss) = self.refine(&reverser, wanted);
        self.reverser = Some(reverser);
        if miss > ARRIVED && self.reverser.as_ref().is_some_and(CageReverser::is_low_rank) {
            let dense = self.factors(CageReverser::dense)?;
            (cage, miss) = self.refine(&dense, wanted);
            self.reverser = Some(dense);
        }
        if miss <= REACHED {
            Ok(cage)
        } else {
            Err(PoseError::Unreachable { miss })
        }
    }

    /// The factors of Eq. (19) in this pose.
    fn factors(&mut self, make: Make) -> Result<CageReverser, PoseError> {
        let linear: Vec<Matrix3> = self.motions.iter().map(|m| m.linear).collect();
        let Binding { cage_updater, skeleton_updater, .. } = &*self.binding;
        self.work.reverse_factorisations += 1;
        let reverser = make(cage_updater, skeleton_updater, &linear, self.ground.shares())?;
        self.work.reverse_low_rank += usize::from(reverser.is_low_rank());
        Ok(reverser)
    }

    /// Solves until the posed cage has arrived at `wanted` or comes no nearer: the rest cage, and by what
    /// part of the size it misses.
    fn refine(&mut self, reverser: &CageReverser, wanted: &[Point]) -> (Vec<Point>, f64) {
        let mut cage = self.rest_cage.clone();
        let mut reached = self.posed_cage.clone();
        let mut miss = f64::INFINITY;
        for _ in 0..SOLVES {
            let step: Vec<Point> = wanted.iter().zip(&reached).map(|(w, r)| w - r).collect();
            let change = reverser.solve(&self.binding.cage_updater, &step);
            let next: Vec<Point> = cage.iter().zip(&change).map(|(c, d)| c + d).collect();
            let joints = self.ground.joints(&self.binding, &next);
            let transforms = self.binding.skeleton_updater.transforms(&self.motions, &joints);
            let posed = self.binding.cage_updater.posed_cage(&self.ground.cage(&next), &transforms);
            self.work.reverse_solves += 1;
            self.work.cage_fits += 1;
            let next_miss =
                largest_distance(&posed, wanted) / bounding_diagonal(self.binding.cage.vertices());
            if next_miss.is_nan() || next_miss >= 0.5 * miss {
                break;
            }
            (cage, reached, miss) = (next, posed, next_miss);
            if miss <= ARRIVED {
                break;
            }
        }
        (cage, miss)
    }
}

fn largest_distance(a: &[Point], b: &[Point]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
}
