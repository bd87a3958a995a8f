//! CageRev where few joints are bent: Eq. (19) without assembling it.
//!
//! A joint whose linear part is its parent's adds nothing to Ω̃ B_topo⁻¹ A_R Ψ. With w_j the weights of
//! all that hangs on joint j, U_j = R_parent − R_j and its share s_j, the system is
//! R̃ Φ̃ + Σ_j (w_j ⊗ U_j)(s_j ψ_jᵀ ⊗ I) over the k bent joints: blocks on the diagonal times a matrix that
//! never changes, and a change of rank 3k. By Woodbury that is two products with `#C by #C` matrices
//! an edit, and a refresh costs `k #C²`.
//!
//! Where CageUp attenuates q directions (Φ̃ = U Σ Vᵀ, parts 1 kept and 2 attenuated), Φ̂ has the limit τ
//! for the small singular values: B = Φ̂⁻¹ R̃ Φ̂ is well conditioned, and the regularised system is B plus
//! (Φ̂⁻¹ R̃ U₂ β)(V₂ᵀ) + (V₂)(α U₂ᵀ R̃ Φ̃ + γ V₂ᵀ R_c) and the joints', rank 6q + 3k, with
//! α = f(Σ₂) − 1/τ, β = Σ₂ − τ and γ = 1 − f(Σ₂) Σ₂.

use super::cage_updater::{Attenuated, CageUpdater};
use super::skeleton_updater::SkeletonUpdater;
use crate::linalg::{product, Lu};
use crate::points::{Matrix3, Point};
use crate::rows::Rows;
use crate::skinning::lbs::blended_linear;
use crate::weights::SkinWeights;

/// A joint turned by less against its parent is not bent: edits are refined against the exact fit.
const BENT: f64 = 1e-6;
/// Blocks whose inverse is larger are left to the dense factors.
const LARGEST_INVERSE: f64 = 1e3;

/// What stands in for Eq. (19).
#[derive(Debug, Clone)]
pub(super) struct LowRank {
    /// R̃⁻¹, a block an anchor.
    unturned: Vec<Matrix3>,
    /// B⁻¹ times the left factors, `3 #C by rank`.
    spread: Rows,
    /// The right factors, `rank by 3 #C`.
    gather: Rows,
    /// I + gather · spread; none without bent joints.
    core: Option<Lu>,
}

impl LowRank {
    /// For `linear` (R_j) and `shares`; `None` where the dense factors are cheaper or safer.
    pub(super) fn new(
        cage: &CageUpdater,
        skeleton: &SkeletonUpdater,
        linear: &[Matrix3],
        shares: &[f64],
    ) -> Option<Self> {
        let base = cage.base()?;
        let bent = bent_joints(skeleton, linear);
        let size = base.matrix.columns();
        let attenuated = base.attenuated.as_ref();
        let few = attenuated.map_or(0, |a| a.strengths.len());
        if 6 * few + 3 * bent.len() > size {
            return None;
        }
        let turns = cage.anchor_linear(linear);
        let unturned: Vec<Matrix3> = turns.iter().map(|turn| turn.try_inverse()).collect::<Option<_>>()?;
        if unturned.iter().any(|inverse| inverse.amax() > LARGEST_INVERSE) {
            return None;
        }
        let mut build = Build { size, lefts: Vec::new(), gathers: Vec::new() };
        if let Some(attenuated) = attenuated {
            build.add_attenuated(cage, attenuated, linear, &turns);
        }
        for &joint in &bent {
            build.add_joint(cage, skeleton, joint, linear, shares);
        }
        let gather = build.gather();
        let spread = build.spread(&base.inverse, &unturned);
        let core = (!gather.is_empty()).then(|| {
            let mut core = product(&gather, &spread);
            (0..core.len()).for_each(|i| core.row_mut(i)[i] += 1.0);
            Lu::new(&core)
        });
        let sound = core.as_ref().is_none_or(|core| core.pivot_ratio() > 1e-10);
        sound.then_some(Self { unturned, spread, gather, core })
    }

    /// ∂C (`#C by 3`) for ∂C′ = `step` (`#C by 3`).
    pub(super) fn solve(&self, cage: &CageUpdater, step: &[Point]) -> Vec<Point> {
        let Some(base) = cage.base() else { return vec![Point::zeros(); step.len()] };
        let anchors = combine_all(&base.matrix, step);
        let turned: Vec<Point> = anchors.iter().zip(&self.unturned).map(|(a, r)| r * a).collect();
        let mut found = combine_all(&base.inverse, &turned);
        if let Some(core) = &self.core {
            let flat: Vec<f64> = found.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
            let seen: Vec<f64> = (0..self.gather.len()).map(|i| dot(self.gather.row(i), &flat)).collect();
            let change = core.solve_one(&seen);
            for (i, point) in found.iter_mut().enumerate() {
                (0..3).for_each(|d| point[d] -= dot(self.spread.row(3 * i + d), &change));
            }
        }
        found
    }
}

/// Joints that are bent against their parents.
fn bent_joints(skeleton: &SkeletonUpdater, linear: &[Matrix3]) -> Vec<usize> {
    (0..linear.len()).filter(|&j| bend(skeleton, linear, j).amax() > BENT).collect()
}

/// U_j.
fn bend(skeleton: &SkeletonUpdater, linear: &[Matrix3], joint: usize) -> Matrix3 {
    let parent = skeleton.skeleton().parent(joint);
    parent.map_or(Matrix3::identity(), |parent| linear[parent]) - linear[joint]
}

/// A left factor, three columns: blocks, one a row of anchors (to be multiplied by R̃⁻¹, Φ̂⁻¹), or of the cage.
enum Left {
    /// B⁻¹ of it is Φ̂⁻¹ R̃⁻¹ of these, `#anchors`.
    Anchors(Vec<Matrix3>),
    /// B⁻¹ of it is this, `#C`.
    Done(Vec<Matrix3>),
}

struct Build {
    size: usize,
    lefts: Vec<Left>,
    gathers: Vec<Vec<Matrix3>>,
}

impl Build {
    fn add(&mut self, left: Left, gather: Vec<Matrix3>) {
        self.lefts.push(left);
        self.gathers.push(gather);
    }

    fn add_attenuated(&mut self, cage: &CageUpdater, of: &Attenuated, linear: &[Matrix3], turns: &[Matrix3]) {
        let cage_turns = blended_linear(linear, &of.cage_weights);
        let coords = cage.anchor_coords();
        for (q, &strength) in of.strengths.iter().enumerate() {
            let (u, v) = (of.left.row(q), of.right.row(q));
            let fit = strength / (of.limit * of.limit);
            let (alpha, beta, gamma) = (fit - 1.0 / of.limit, strength - of.limit, 1.0 - fit * strength);
            // B⁻¹ Φ̂⁻¹ R̃ U₂ β = V₂ β/τ.
            let scaled = v.iter().map(|x| Matrix3::identity() * (x * beta / of.limit)).collect();
            self.add(Left::Done(scaled), v.iter().map(|x| Matrix3::identity() * *x).collect());
            // Φ̂ V₂ = U₂ τ.
            let left = u.iter().map(|x| Matrix3::identity() * (x * of.limit)).collect();
            let mut gather: Vec<Matrix3> = v.iter().zip(&cage_turns).map(|(x, r)| r * (gamma * x)).collect();
            for (i, turn) in turns.iter().enumerate() {
                let factor = turn * (alpha * u[i]);
                gather.iter_mut().zip(coords.row(i)).for_each(|(sum, phi)| *sum += factor * *phi);
            }
            self.add(Left::Anchors(left), gather);
        }
    }

    fn add_joint(
        &mut self,
        cage: &CageUpdater,
        skeleton: &SkeletonUpdater,
        joint: usize,
        linear: &[Matrix3],
        shares: &[f64],
    ) {
        let bend = bend(skeleton, linear, joint);
        let below = skeleton.skeleton().below(joint);
        let mut anchors = hanging(cage.anchor_weights(), &below);
        // Φ̂ (P w + Q w_c) = w + U₂ ((τ f − 1) U₂ᵀ w + τ γ V₂ᵀ w_c).
        if let Some(of) = cage.base().and_then(|base| base.attenuated.as_ref()) {
            let (at_anchors, at_cage) = (anchors.clone(), hanging(&of.cage_weights, &below));
            for (q, &strength) in of.strengths.iter().enumerate() {
                let fit = strength / (of.limit * of.limit);
                let part = (of.limit * fit - 1.0) * dot(of.left.row(q), &at_anchors)
                    + of.limit * (1.0 - fit * strength) * dot(of.right.row(q), &at_cage);
                anchors.iter_mut().zip(of.left.row(q)).for_each(|(w, u)| *w += part * u);
            }
        }
        let coords = skeleton.joint_coords().row(joint);
        let gather = coords.iter().map(|psi| Matrix3::identity() * (psi * shares[joint])).collect();
        self.add(Left::Anchors(anchors.iter().map(|w| bend * *w).collect()), gather);
    }

    fn gather(&self) -> Rows {
        let mut rows = Rows::zeros(3 * self.gathers.len(), 3 * self.size);
        for (n, blocks) in self.gathers.iter().enumerate() {
            for (k, block) in blocks.iter().enumerate() {
                for d in 0..3 {
                    (0..3).for_each(|e| rows.row_mut(3 * n + d)[3 * k + e] = block[(d, e)]);
                }
            }
        }
        rows
    }

    /// B⁻¹ times the left factors: one product with Φ̂⁻¹ for all of them.
    fn spread(&self, inverse: &Rows, unturned: &[Matrix3]) -> Rows {
        let rank = 3 * self.lefts.len();
        let mut rows = Rows::zeros(3 * self.size, rank);
        for (n, left) in self.lefts.iter().enumerate() {
            if let Left::Anchors(blocks) = left {
                for (i, block) in blocks.iter().enumerate() {
                    put(&mut rows, i, n, &(unturned[i] * block));
                }
            }
        }
        if rank == 0 {
            return rows;
        }
        // A point's three rows lie side by side: one long row of the right factor.
        let mut rows = product(inverse, &rows.reshaped(3 * rank)).reshaped(rank);
        for (n, left) in self.lefts.iter().enumerate() {
            if let Left::Done(blocks) = left {
                blocks.iter().enumerate().for_each(|(i, block)| put(&mut rows, i, n, block));
            }
        }
        rows
    }
}

fn put(rows: &mut Rows, row: usize, column: usize, block: &Matrix3) {
    for d in 0..3 {
        (0..3).for_each(|e| rows.row_mut(3 * row + d)[3 * column + e] = block[(d, e)]);
    }
}

/// What `joints` (true) weigh at each row.
fn hanging(weights: &SkinWeights, joints: &[bool]) -> Vec<f64> {
    let sum = |i: usize| weights.row(i).iter().filter(|(j, _)| joints[*j as usize]).map(|(_, w)| w).sum();
    (0..weights.len()).map(sum).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums, which need not wait for one another.
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        (0..4).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums[0] + sums[1] + sums[2] + sums[3] + rest
}

fn combine_all(rows: &Rows, points: &[Point]) -> Vec<Point> {
    (0..rows.len()).map(|i| rows.combine(i, points)).collect()
}
