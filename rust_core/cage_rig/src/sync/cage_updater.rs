//! CageUp: the posed cage that belongs to the posed skin.
//!
//! Based on [CTL*20] Eq. (8): Φ̃ C′ = M̃′, where Φ̃ are the rows of Φ at c anchor vertices chosen by
//! MaxVol. Factored once at bind; one solve of `#C²` per call. The anchors are posed by linear
//! blending whatever moves the visible skin, so that CageRev can be exact for every method.
//!
//! A cage vertex that hardly touches the skin makes Φ̃ singular, and Eq. (8) throws it far away.
//! Singular values below a limit τ are attenuated toward the cage skinned by weights carried over
//! to it, C_s: C′ = C_s + V f(Σ) Uᵀ (M̃′ − Φ̃ C_s), with f(σ) = 1/σ from τ on and σ/τ² below.
//! Where nothing is below τ this is Eq. (8). All in displacements from rest, exact at rest.

use super::joint_coordinates::SkinAtRest;
use crate::linalg::{product, svd, Lu, Svd};
use crate::points::{Matrix3, Point, Transform};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use crate::skinning::lbs::{blended_linear, pose_steps_into};
use crate::weights::SkinWeights;

/// Skin vertices between two looks at the progress.
const ROWS: usize = 1024;

/// Anchors and cage of the bind, and the factors of Φ̃.
#[derive(Debug, Clone)]
pub struct CageUpdater {
    anchor_coords: Rows,
    anchor_rest: Vec<Point>,
    anchor_weights: SkinWeights,
    cage: Vec<Point>,
    fit: Fit,
    base: Option<Base>,
    condition: f64,
}

/// What a fit works with.
#[derive(Debug, Clone, Default)]
pub struct FitScratch {
    moved: Vec<Point>,
    rest: Vec<Point>,
    steps: Vec<Point>,
    numbers: Vec<f64>,
}

/// Φ̂ and its inverse: Φ̃ with no singular value below the limit.
#[derive(Debug, Clone)]
pub(super) struct Base {
    /// Φ̂, `#C by #C`.
    pub(super) matrix: Rows,
    /// Φ̂⁻¹.
    pub(super) inverse: Rows,
    /// How it differs from Φ̃.
    pub(super) attenuated: Option<Attenuated>,
}

/// The directions that are attenuated.
#[derive(Debug, Clone)]
pub(super) struct Attenuated {
    /// Columns of U, as rows over the anchors.
    pub(super) left: Rows,
    /// Columns of V, as rows over the cage.
    pub(super) right: Rows,
    /// Their singular values.
    pub(super) strengths: Vec<f64>,
    /// τ.
    pub(super) limit: f64,
    /// The weights of C_s.
    pub(super) cage_weights: SkinWeights,
}

/// How the cage is found from the anchors.
#[derive(Debug, Clone)]
enum Fit {
    /// Eq. (8).
    Exact(Lu),
    /// P = V f(Σ) Uᵀ (`#C by #anchors`), Q = I − P Φ̃, the weights of C_s, and how many of the
    /// `#C` directions are attenuated.
    Regularised { from_anchors: Rows, from_cage: Rows, cage_weights: SkinWeights, attenuated: usize },
}

/// The linear map of a change of the rest cage to the change of the posed one, before the bones'
/// translations: blended linear parts at anchors and cage. See `cage_reverser.rs`.
pub(super) enum Side<'a> {
    /// Everything at the anchors: Eq. (19) as printed.
    Anchors,
    /// P, Q and the weights of C_s.
    Both { from_anchors: &'a Rows, from_cage: &'a Rows, cage_weights: &'a SkinWeights },
}

impl CageUpdater {
    /// Factors Φ̃. `anchors` are vertices of `skin`, `cage` is C₀; `min_singular` is τ relative to the largest singular value.
    pub fn new(
        anchors: &[usize],
        skin: &SkinAtRest,
        cage: &[Point],
        min_singular: f64,
        part: &Part,
    ) -> Result<Self, Cancelled> {
        let anchor_coords = skin.cage_coords.select(anchors);
        let (fit, base, condition) = fit(&anchor_coords, min_singular, || cage_skin_weights(skin, part))?;
        Ok(Self {
            anchor_coords,
            anchor_rest: anchors.iter().map(|&i| skin.vertices[i]).collect(),
            anchor_weights: skin.weights.select(anchors),
            cage: cage.to_vec(),
            fit,
            base,
            condition,
        })
    }

    /// Largest over smallest singular value of Φ̃.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// Directions that are attenuated; 0 where Eq. (8) is solved as printed.
    pub fn attenuated(&self) -> usize {
        match &self.fit {
            Fit::Exact(_) => 0,
            Fit::Regularised { attenuated, .. } => *attenuated,
        }
    }

    /// The posed cage C′ (`#C by 3`) of rest cage `cage` (C) under `transforms`, Eq. (8).
    pub fn posed_cage(&self, cage: &[Point], transforms: &[Transform]) -> Vec<Point> {
        let mut posed = Vec::new();
        self.posed_cage_into(cage, transforms, &mut FitScratch::default(), &mut posed);
        posed
    }

    /// The same, written into `posed`.
    pub fn posed_cage_into(
        &self,
        cage: &[Point],
        transforms: &[Transform],
        scratch: &mut FitScratch,
        posed: &mut Vec<Point>,
    ) {
        let FitScratch { moved, rest, steps, numbers } = scratch;
        moved.clear();
        moved.extend(cage.iter().zip(&self.cage).map(|(c, c0)| c - c0));
        self.anchor_coords.times_into(moved, rest);
        rest.iter_mut().zip(&self.anchor_rest).for_each(|(moved, rest)| *moved += rest);
        pose_steps_into(transforms, &self.anchor_weights, rest, steps);
        match &self.fit {
            Fit::Exact(lu) => lu.solve_points_into(steps, numbers, posed),
            Fit::Regularised { from_anchors, from_cage, cage_weights, .. } => {
                from_anchors.times_into(steps, posed);
                pose_steps_into(transforms, cage_weights, cage, steps);
                from_cage.times_into(steps, rest);
                posed.iter_mut().zip(&*rest).for_each(|(posed, step)| *posed += step);
            }
        }
        posed.iter_mut().zip(cage).for_each(|(step, c)| *step += c);
    }

    /// Φ̂, where there are as many anchors as cage vertices.
    pub(super) fn base(&self) -> Option<&Base> {
        self.base.as_ref()
    }

    pub(super) fn side(&self) -> Side<'_> {
        match &self.fit {
            Fit::Exact(_) => Side::Anchors,
            Fit::Regularised { from_anchors, from_cage, cage_weights, .. } => {
                Side::Both { from_anchors, from_cage, cage_weights }
            }
        }
    }

    /// Φ̃, `#anchors by #C`.
    pub fn anchor_coords(&self) -> &Rows {
        &self.anchor_coords
    }

    /// Ω̃, the rows of Ω at the anchors.
    pub fn anchor_weights(&self) -> &SkinWeights {
        &self.anchor_weights
    }

    /// R̃ of Eq. (19): the blended linear part at each anchor.
    pub(super) fn anchor_linear(&self, linear: &[Matrix3]) -> Vec<Matrix3> {
        blended_linear(linear, &self.anchor_weights)
    }
}

fn fit(
    anchor_coords: &Rows,
    min_singular: f64,
    cage_weights: impl Fn() -> Result<SkinWeights, Cancelled>,
) -> Result<(Fit, Option<Base>, f64), Cancelled> {
    let count = anchor_coords.columns();
    let lu = Lu::new(anchor_coords);
    let Some(svd) = svd(anchor_coords) else { return Ok((Fit::Exact(lu), None, f64::INFINITY)) };
    let largest = svd.singular_values.first().copied().unwrap_or(0.0);
    let smallest = svd.singular_values.last().copied().unwrap_or(0.0);
    let missing = count - svd.singular_values.len();
    let condition = if missing > 0 { f64::INFINITY } else { largest / smallest };
    let limit = min_singular * largest;
    let attenuated = missing + svd.singular_values.iter().filter(|s| **s < limit).count();
    if attenuated == 0 {
        let base = Base { matrix: anchor_coords.clone(), inverse: lu.inverse(), attenuated: None };
        return Ok((Fit::Exact(lu), Some(base), condition));
    }
    let mut scaled = svd.v.clone();
    for k in 0..count {
        for (x, &s) in scaled.row_mut(k).iter_mut().zip(&svd.singular_values) {
            *x *= if s >= limit { 1.0 / s } else { s / (limit * limit) };
        }
    }
    let from_anchors = product(&scaled, &svd.u.transposed());
    let mut from_cage = product(&from_anchors, anchor_coords);
    for k in 0..count {
        from_cage.row_mut(k).iter_mut().for_each(|x| *x = -*x);
        from_cage.row_mut(k)[k] += 1.0;
    }
    let cage_weights = cage_weights()?;
    let base = (missing == 0).then(|| base(anchor_coords, &svd, limit, &cage_weights));
    Ok((Fit::Regularised { from_anchors, from_cage, cage_weights, attenuated }, base, condition))
}

fn base(anchor_coords: &Rows, svd: &Svd, limit: f64, cage_weights: &SkinWeights) -> Base {
    let (u, v) = (svd.u.transposed(), svd.v.transposed());
    let values = &svd.singular_values;
    let small: Vec<usize> = (0..values.len()).filter(|&k| values[k] < limit).collect();
    let (left, right) = (u.select(&small), v.select(&small));
    let strengths: Vec<f64> = small.iter().map(|&k| values[k]).collect();
    let mut matrix = anchor_coords.clone();
    for (q, strength) in strengths.iter().enumerate() {
        for i in 0..matrix.len() {
            let factor = left.row(q)[i] * (limit - strength);
            matrix.row_mut(i).iter_mut().zip(right.row(q)).for_each(|(x, v)| *x += factor * v);
        }
    }
    let mut scaled = svd.v.clone();
    for k in 0..scaled.len() {
        scaled.row_mut(k).iter_mut().zip(values).for_each(|(x, s)| *x /= s.max(limit));
    }
    let inverse = product(&scaled, &u);
    let attenuated = Attenuated { left, right, strengths, limit, cage_weights: cage_weights.clone() };
    Base { matrix, inverse, attenuated: Some(attenuated) }
}

/// The skin weights carried over to the cage: w_k = Σ_i φ_ik² ω_i / Σ_i φ_ik² over the skin that it
/// reaches. A cage vertex that touches no skin vertex at all gets no weights and stands still.
pub fn cage_skin_weights(skin: &SkinAtRest, part: &Part) -> Result<SkinWeights, Cancelled> {
    let SkinAtRest { cage_coords, weights, reach, .. } = skin;
    let mut sums = Rows::zeros(cage_coords.columns(), weights.joints());
    let mut totals = vec![0.0; cage_coords.columns()];
    let count = part.count(cage_coords.len());
    for i in 0..cage_coords.len() {
        if i % ROWS == 0 {
            count.step(ROWS)?;
        }
        for (k, phi) in cage_coords.row(i).iter().enumerate() {
            let share = phi * phi * reach[i];
            totals[k] += share;
            for &(joint, weight) in weights.row(i) {
                sums.row_mut(k)[joint as usize] += share * weight;
            }
        }
    }
    for (k, total) in totals.iter().enumerate().filter(|(_, total)| **total > 0.0) {
        sums.row_mut(k).iter_mut().for_each(|w| *w /= total);
    }
    Ok(SkinWeights::from_blended(&sums))
}
