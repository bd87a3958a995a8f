//! CageRev: the rest cage whose posed cage is the one the artist made.
//!
//! Based on [CTL*20] §4.4, Eq. (19): (R̃ Φ̃ + Ω̃ B_topo⁻¹ A_R Ψ) ∂C = Φ̃ ∂C′. For fixed linear
//! parts R_j the posed cage is affine in the rest cage, so this is exact, not a first order. A dense
//! LU of 3c unknowns (not normal equations), made once per change of the linear parts; then one
//! solve per edit, `9 #C²`.
//!
//! Where CageUp is regularised, ∂C′ = P ∂M̃′ + Q ∂C_s gives the same system with both sides:
//! (P (R̃ Φ̃ + Ω̃ G) + Q (R_c + W_c G)) ∂C = ∂C′, where G = B_topo⁻¹ A_R Ψ.

use super::cage_updater::{CageUpdater, Side};
use super::skeleton_updater::SkeletonUpdater;
use crate::error::PoseError;
use crate::linalg::{product, Lu};
use crate::points::{Matrix3, Point};
use crate::rows::Rows;
use crate::skinning::lbs::blended_linear;
use crate::weights::SkinWeights;

/// Below this ratio of pivots a bone is squashed flat.
const SINGULAR: f64 = 1e-15;

/// The factors of Eq. (19) for one set of linear parts.
#[derive(Debug, Clone)]
pub struct CageReverser {
    factors: Lu,
    /// Φ̃ of the right side; none where the system is already in terms of the cage.
    right: Option<Rows>,
}

impl CageReverser {
    /// Assembles and factors Eq. (19) for `linear` (R_j, one per joint). Joint j takes part in the
    /// cage's movement by `shares[j]`.
    pub fn new(
        cage: &CageUpdater,
        skeleton: &SkeletonUpdater,
        linear: &[Matrix3],
        shares: &[f64],
    ) -> Result<Self, PoseError> {
        let gradient = skeleton.translation_gradient(linear, shares);
        let mut at_anchors = weighted_gradient(cage.anchor_weights(), &gradient);
        let coords = cage.anchor_coords();
        for (i, turn) in cage.anchor_linear(linear).iter().enumerate() {
            for (k, phi) in coords.row(i).iter().enumerate() {
                add_block(&mut at_anchors, i, k, &(turn * *phi));
            }
        }
        let (system, right) = match cage.side() {
            Side::Anchors => (at_anchors, Some(coords.clone())),
            Side::Both { from_anchors, from_cage, cage_weights } => {
                let mut at_cage = weighted_gradient(cage_weights, &gradient);
                for (k, turn) in blended_linear(linear, cage_weights).iter().enumerate() {
                    add_block(&mut at_cage, k, k, turn);
                }
                let mut system = spread_product(from_anchors, &at_anchors);
                let other = spread_product(from_cage, &at_cage);
                system.as_mut_slice().iter_mut().zip(other.as_slice()).for_each(|(a, b)| *a += b);
                (system, None)
            }
        };
        let factors = Lu::new(&system);
        let pivot_ratio = factors.pivot_ratio();
        if pivot_ratio < SINGULAR {
            return Err(PoseError::Singular { pivot_ratio });
        }
        Ok(Self { factors, right })
    }

    /// ∂C (`#C by 3`) for ∂C′ = `step` (`#C by 3`).
    pub fn solve(&self, step: &[Point]) -> Vec<Point> {
        match &self.right {
            Some(coords) => self.factors.solve_interleaved(&coords.times(step)),
            None => self.factors.solve_interleaved(step),
        }
    }
}

/// Ω̃ G: `3 #rows by 3 #C`, x y z of each point in turn.
fn weighted_gradient(weights: &SkinWeights, gradient: &[Vec<Matrix3>]) -> Rows {
    let columns = gradient.first().map_or(0, Vec::len);
    let mut out = Rows::zeros(3 * weights.len(), 3 * columns);
    let mut blocks = vec![Matrix3::zeros(); columns];
    for i in 0..weights.len() {
        blocks.fill(Matrix3::zeros());
        for &(joint, weight) in weights.row(i) {
            let row = &gradient[joint as usize];
            blocks.iter_mut().zip(row).for_each(|(sum, block)| *sum += block * weight);
        }
        blocks.iter().enumerate().for_each(|(k, block)| add_block(&mut out, i, k, block));
    }
    out
}

fn add_block(matrix: &mut Rows, row: usize, column: usize, block: &Matrix3) {
    for d in 0..3 {
        let target = &mut matrix.row_mut(3 * row + d)[3 * column..3 * column + 3];
        target.iter_mut().enumerate().for_each(|(e, x)| *x += block[(d, e)]);
    }
}

/// (P ⊗ I₃) A: a matrix that mixes points, applied to each coordinate alike. Row-major, the three
/// coordinate rows of a point lie side by side, so they are one long row of P's right factor.
fn spread_product(mixing: &Rows, blocks: &Rows) -> Rows {
    product(mixing, &blocks.clone().reshaped(3 * blocks.columns())).reshaped(blocks.columns())
}
