//! Dual quaternion skinning: bones blend as rigid motions, so that joints keep their volume.
//!
//! Based on [KCZO08], Eq. (4) of [CTL*20]: the unit dual quaternions q̂_j of the bones are blended,
//! q̂ = Σ_j ω_ij q̂_j, normalised, and move v. With q = Σ ω q_j and d = Σ ω d_j (real and dual part):
//! v′ = v + 2 (u × (u × v + w v) + w d_u − d_w u + u × d_u) / |q|², u and w vector and scalar of q.
//!
//! Two phases where bones scale or shear: T_j = R_j S_j (polar), and first the scale alone takes v
//! to S_j v; what that moves v by joins the translation, τ_j(v) = T_j(v) − R_j v. Then the rigid
//! motions (R_j, τ_j) are blended. [KCZO08] §4.2 blends the S_j about the origin, and so depends on
//! where the origin is; here S_j holds v itself fixed, as in Blender's Preserve Volume. A vertex of
//! one bone goes where the bone takes it, and bones that only scale and move blend linearly.
//!
//! q̂ and −q̂ are the same motion: per vertex each bone takes the sign that is nearer to the bone of
//! its largest weight (the first of equal ones). What the weights lack to 1 blends in as identity.
//! Cost: 20 numbers per influence, 8 where no bone scales.

use super::rotation::{matrix_of, rotation_of, Quaternion};
use super::{each_vertex, SkinningInput};
use crate::points::{Matrix3, Point, Transform};

/// Scale and shear below this, relative, are rounding of single precision transforms.
const RIGID: f64 = 1e-7;
/// Weights that lack less than this to 1 lack nothing but rounding.
pub(super) const COMPLETE: f32 = 1e-6;

/// Real part, dual part of (R, t).
const RIGID_SIZE: usize = 8;
/// The same and the dual part of (1, (L − R) v) as a matrix, columns first.
const AFFINE_SIZE: usize = 20;

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, posed: &mut [[f32; 3]]) {
    let bones: Vec<[f64; AFFINE_SIZE]> = input.transforms.iter().map(dual_quaternion).collect();
    if bones.iter().all(|bone| bone[RIGID_SIZE..].iter().all(|x| x.abs() <= RIGID)) {
        blend_bones::<RIGID_SIZE>(&bones, input, posed);
    } else {
        blend_bones::<AFFINE_SIZE>(&bones, input, posed);
    }
}

fn blend_bones<const N: usize>(bones: &[[f64; AFFINE_SIZE]], input: &SkinningInput, posed: &mut [[f32; 3]]) {
    let bones: Vec<[f32; N]> = bones.iter().map(|bone| std::array::from_fn(|k| bone[k] as f32)).collect();
    each_vertex(input, posed, |_, influences, v| moved(&bones, influences, v));
}

fn dual_quaternion(transform: &Transform) -> [f64; AFFINE_SIZE] {
    let q = rotation_of(&transform.linear);
    let sheared: Matrix3 = transform.linear - matrix_of(q);
    let mut bone = [0.0; AFFINE_SIZE];
    bone[..4].copy_from_slice(&q);
    bone[4..8].copy_from_slice(&dual_of(q, transform.translation));
    for column in 0..3 {
        bone[8 + 4 * column..][..4].copy_from_slice(&dual_of(q, sheared.column(column).into()));
    }
    bone
}

/// ½ t q.
fn dual_of([x, y, z, w]: Quaternion, t: Point) -> Quaternion {
    let u = Point::new(x, y, z);
    let vector = (t * w + t.cross(&u)) / 2.0;
    [vector.x, vector.y, vector.z, -t.dot(&u) / 2.0]
}

/// v′ of one vertex.
#[inline]
fn moved<const N: usize>(bones: &[[f32; N]], influences: &[(u32, f32)], v: [f32; 3]) -> [f32; 3] {
    let Some(&(pivot, _)) = influences.first() else { return v };
    let pivot = &bones[pivot as usize];
    let mut blend = [0.0f32; N];
    let mut lack = 1.0f32;
    for &(joint, weight) in influences {
        let bone = &bones[joint as usize];
        lack -= weight;
        let weight = if agree(bone, pivot) { weight } else { -weight };
        blend.iter_mut().zip(bone).for_each(|(sum, x)| *sum += weight * x);
    }
    if lack > COMPLETE {
        blend[3] += lack.copysign(pivot[3]);
    }
    let mut dual = [blend[4], blend[5], blend[6], blend[7]];
    for (column, x) in blend[8..].chunks_exact(4).zip(v) {
        dual.iter_mut().zip(column).for_each(|(sum, d)| *sum += d * x);
    }
    let u = [blend[0], blend[1], blend[2]];
    let w = blend[3];
    let turned = cross(u, v);
    let carried = cross(u, [dual[0], dual[1], dual[2]]);
    let inner = cross(u, std::array::from_fn(|d| turned[d] + w * v[d]));
    let scale = 2.0 / (u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + w * w);
    std::array::from_fn(|d| v[d] + scale * (inner[d] + w * dual[d] - dual[3] * u[d] + carried[d]))
}

/// Do two quaternions (the first four numbers) lie on the same half of their sphere?
#[inline]
pub(super) fn agree(a: &[f32], b: &[f32]) -> bool {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] >= 0.0
}

#[inline]
pub(super) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
