//! CageRev: the rest cage whose posed cage is the one the artist made.
//!
//! Based on [CTL*20] §4.4, Eq. (19): (R̃ Φ̃ + Ω̃ B_topo⁻¹ A_R Ψ) ∂C = Φ̃ ∂C′. For fixed linear
//! parts R_j the posed cage is affine in the rest cage, so this is exact, not a first order. A dense
//! LU of 3c unknowns (not normal equations), made once per change of the linear parts; then one
//! solve per edit, `9 #C²`.
//!
//! Where few joints are bent against their parents, the same is solved without assembling it, see
//! `low_rank.rs`; its answers are refined against the exact fit, and the dense factors stand in where
//! that does not arrive.
//!
//! Where CageUp is regularised, ∂C′ = P ∂M̃′ + Q ∂C_s gives the same system with both sides:
//! (P (R̃ Φ̃ + Ω̃ G) + Q (R_c + W_c G)) ∂C = ∂C′, where G = B_topo⁻¹ A_R Ψ.

use super::cage_updater::{Base, CageUpdater, Side};
use super::low_rank::LowRank;
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
    factors: Factors,
}

#[derive(Debug, Clone)]
enum Factors {
    /// LU of all, and Φ̃ of the right side; none where the system is already in terms of the cage.
    Dense(Lu, Option<Rows>),
    LowRank(LowRank),
}

impl CageReverser {
    /// Whichever is cheaper for `linear` (R_j, one per joint); `shares` as of [`Self::dense`].
    pub fn new(
        cage: &CageUpdater,
        skeleton: &SkeletonUpdater,
        linear: &[Matrix3],
        shares: &[f64],
    ) -> Result<Self, PoseError> {
        match LowRank::new(cage, skeleton, linear, shares) {
            Some(factors) => Ok(Self { factors: Factors::LowRank(factors) }),
            None => Self::dense(cage, skeleton, linear, shares),
        }
    }

    /// Whether it is of low rank.
    pub fn is_low_rank(&self) -> bool {
        matches!(self.factors, Factors::LowRank(_))
    }

    /// Assembles and factors Eq. (19) for `linear` (R_j, one per joint). Joint j takes part in the
    /// cage's movement by `shares[j]`.
    pub fn dense(
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
                if let Some(base) = cage.base() {
                    let system = lifted(base, at_anchors, at_cage);
                    return Self::factored(&system, Some(base.matrix.clone()));
                }
                let mut system = spread_product(from_anchors, &at_anchors);
                let other = spread_product(from_cage, &at_cage);
                system.as_mut_slice().iter_mut().zip(other.as_slice()).for_each(|(a, b)| *a += b);
                (system, None)
            }
        };
        Self::factored(&system, right)
    }

    fn factored(system: &Rows, right: Option<Rows>) -> Result<Self, PoseError> {
        let factors = Lu::new(system);
        let pivot_ratio = factors.pivot_ratio();
        if pivot_ratio < SINGULAR {
            return Err(PoseError::Singular { pivot_ratio });
        }
        Ok(Self { factors: Factors::Dense(factors, right) })
    }

    /// ∂C (`#C by 3`) for ∂C′ = `step` (`#C by 3`); `cage` is that of the construction.
    pub fn solve(&self, cage: &CageUpdater, step: &[Point]) -> Vec<Point> {
        match &self.factors {
            Factors::Dense(factors, Some(coords)) => factors.solve_interleaved(&coords.times(step)),
            Factors::Dense(factors, None) => factors.solve_interleaved(step),
            Factors::LowRank(factors) => factors.solve(cage, step),
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

/// Φ̂ times the regularised system, of low rank beside `at_anchors` (see `low_rank.rs`):
/// A + U₂ ((τ f(Σ₂) − 1) U₂ᵀ A + τ γ V₂ᵀ A_c).
fn lifted(base: &Base, at_anchors: Rows, at_cage: Rows) -> Rows {
    let Some(of) = &base.attenuated else { return at_anchors };
    let (columns, width) = (at_anchors.columns(), 3 * at_anchors.columns());
    let mut system = at_anchors.reshaped(width);
    let mut mixed = product(&of.left, &system);
    let skinned = product(&of.right, &at_cage.reshaped(width));
    for (q, strength) in of.strengths.iter().enumerate() {
        let fit = strength / (of.limit * of.limit);
        let (own, other) = (of.limit * fit - 1.0, of.limit * (1.0 - fit * strength));
        mixed.row_mut(q).iter_mut().zip(skinned.row(q)).for_each(|(x, y)| *x = own * *x + other * y);
    }
    let change = product(&of.left.transposed(), &mixed);
    system.as_mut_slice().iter_mut().zip(change.as_slice()).for_each(|(x, y)| *x += y);
    system.reshaped(columns)
}

/// (P ⊗ I₃) A: a matrix that mixes points, applied to each coordinate alike. Row-major, the three
/// coordinate rows of a point lie side by side, so they are one long row of P's right factor.
fn spread_product(mixing: &Rows, blocks: &Rows) -> Rows {
    product(mixing, &blocks.clone().reshaped(3 * blocks.columns())).reshaped(blocks.columns())
}
