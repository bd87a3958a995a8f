//! Linear blend skinning: the weighted mean of what the bones do.
//!
//! Based on [CTL*20] Eq. (2–3), v′ = Σ_j ω_ij (R_j v + t_j), with what the weights lack to 1
//! standing still: v′ = Σ_j ω_ij (R_j v + t_j) + (1 − Σ_j ω_ij) v. Written as a displacement,
//! v′ = v + Σ_j ω_ij ((R_j − I) v + t_j), that needs no case of its own and is exact at rest.
//! Linear parts may scale and shear. Cost: one small sum per influence.

use super::{each_vertex, SkinningInput};
use crate::points::{Matrix3, Point, Transform};
use crate::weights::SkinWeights;

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, posed: &mut [[f32; 3]]) {
    let bones: Vec<[f32; 12]> = input.transforms.iter().map(displacement).collect();
    each_vertex(input, posed, |_, influences, v| displaced(&bones, influences, v));
}

/// R − I and t, columns first.
fn displacement(transform: &Transform) -> [f32; 12] {
    let linear = transform.linear - Matrix3::identity();
    std::array::from_fn(|k| if k < 9 { linear[(k % 3, k / 3)] } else { transform.translation[k - 9] } as f32)
}

#[inline]
fn displaced(bones: &[[f32; 12]], influences: &[(u32, f32)], v: [f32; 3]) -> [f32; 3] {
    let mut blend = [0.0f32; 12];
    for &(joint, weight) in influences {
        let bone = &bones[joint as usize];
        blend.iter_mut().zip(bone).for_each(|(sum, x)| *sum += weight * x);
    }
    std::array::from_fn(|d| {
        v[d] + (blend[d] * v[0] + blend[3 + d] * v[1] + blend[6 + d] * v[2] + blend[9 + d])
    })
}

/// The same in double precision, for anchors and cage: `points` (`#P by 3`) moved by rows of Ω.
pub fn pose_points(transforms: &[Transform], weights: &SkinWeights, points: &[Point]) -> Vec<Point> {
    points.iter().enumerate().map(|(i, v)| v + displacement_at(transforms, weights.row(i), v)).collect()
}

fn displacement_at(transforms: &[Transform], influences: &[(u32, f64)], v: &Point) -> Point {
    influences.iter().map(|&(joint, weight)| weight * (transforms[joint as usize].apply(v) - v)).sum()
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
