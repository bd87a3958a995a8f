//! Linear blend skinning: the weighted mean of what the bones do.
//!
//! Based on [CTL*20] Eq. (2–3), v′ = Σ_j ω_ij (R_j v + t_j), with what the weights lack to 1
//! standing still: v′ = Σ_j ω_ij (R_j v + t_j) + (1 − Σ_j ω_ij) v. Written as a displacement,
//! v′ = v + Σ_j ω_ij ((R_j − I) v + t_j), that needs no case of its own and is exact at rest.
//! Linear parts may scale and shear. Cost: 12 numbers per influence.

use super::blocks::{each_vertex, Mover, Row};
use super::scratch::Scratch;
use super::vectors::{add, affine, Three};
use super::SkinningInput;
use crate::points::{Matrix3, Point, Transform};
use crate::simd::Lanes;
use crate::weights::SkinWeights;

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, scratch: &mut Scratch, posed: &mut [[f32; 3]]) {
    let table = scratch.table(input.transforms, displacement);
    each_vertex(Linear, table, input, posed);
}

/// R − I and t, a row of the matrix each.
pub(super) fn displacement(transform: &Transform) -> Row<4> {
    let linear = transform.linear - Matrix3::identity();
    let row = |d: usize| [linear[(d, 0)], linear[(d, 1)], linear[(d, 2)], transform.translation[d]];
    std::array::from_fn(|d| if d < 3 { row(d).map(|x| x as f32) } else { [0.0; 4] })
}

#[derive(Clone, Copy)]
struct Linear;

impl Mover<4> for Linear {
    const PAIRS: bool = false;
    const CENTERS: bool = false;

    #[inline(always)]
    fn moved<L: Lanes>(lanes: L, rows: &[Row<4>], v: Three<L>, _: Three<L>) -> Three<L> {
        let matrix = [lanes.columns(rows, 0), lanes.columns(rows, 1), lanes.columns(rows, 2)];
        add(lanes, v, affine(lanes, matrix, v))
    }
}

/// What moves anchors and cage, in double precision: writes the steps of `points` (`#P by 3`) under rows
/// of Ω.
pub fn pose_steps_into(
    transforms: &[Transform],
    weights: &SkinWeights,
    points: &[Point],
    steps: &mut Vec<Point>,
) {
    let step = |(i, v): (usize, &Point)| -> Point {
        let influences = weights.row(i).iter();
        influences.map(|&(joint, weight)| weight * (transforms[joint as usize].apply(v) - v)).sum()
    };
    steps.clear();
    steps.extend(points.iter().enumerate().map(step));
}

/// The linear part of the blend: R̃ = Σ_j ω_ij R_j + (1 − Σ_j ω_ij) I, one per row of Ω.
pub fn blended_linear(linear: &[Matrix3], weights: &SkinWeights) -> Vec<Matrix3> {
    let blend = |row: &[(u32, f64)]| {
        let moved: Matrix3 =
            row.iter().map(|&(joint, weight)| weight * (linear[joint as usize] - Matrix3::identity())).sum();
        Matrix3::identity() + moved
    };
    (0..weights.len()).map(|i| blend(weights.row(i))).collect()
}
