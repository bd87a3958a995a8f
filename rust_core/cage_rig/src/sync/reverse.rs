//! An edit of the posed cage, carried back to the rest cage until it is posed as wanted.

use super::cage_reverser::CageReverser;
use super::{Binding, CoupledRig};
use crate::error::PoseError;
use crate::points::{bounding_diagonal, Matrix3, Point};

/// A posed cage edit has arrived when it misses by this part of the size.
const ARRIVED: f64 = 1e-12;
/// An edit that ends farther away than this is refused.
const REACHED: f64 = 1e-10;
/// Solves an edit may take: one, and refinements where Eq. (19) is badly conditioned.
const SOLVES: usize = 4;

impl CoupledRig {
    /// The rest cage whose posed cage is `wanted`. Changes nothing but the kept factors.
    pub(super) fn reverse(&mut self, wanted: &[Point]) -> Result<Vec<Point>, PoseError> {
        let reverser = match self.reverser.take() {
            Some(reverser) => reverser,
            None => {
                self.work.reverse_factorisations += 1;
                let linear: Vec<Matrix3> = self.motions.iter().map(|m| m.linear).collect();
                let Binding { cage_updater, skeleton_updater, .. } = &*self.binding;
                CageReverser::new(cage_updater, skeleton_updater, &linear, self.ground.shares())?
            }
        };
        let mut cage = self.rest_cage.clone();
        let mut reached = self.posed_cage.clone();
        let mut miss = f64::INFINITY;
        for _ in 0..SOLVES {
            let step: Vec<Point> = wanted.iter().zip(&reached).map(|(w, r)| w - r).collect();
            let change = reverser.solve(&step);
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
        self.reverser = Some(reverser);
        if miss <= REACHED {
            Ok(cage)
        } else {
            Err(PoseError::Unreachable { miss })
        }
    }
}

fn largest_distance(a: &[Point], b: &[Point]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
}
