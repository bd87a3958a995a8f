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
//! one bone goes where the bone takes it, and bones that only scale and move blend linearly. Blender
//! knows the bones' own axes and keeps theirs where we take the nearest rotation: the two agree but
//! for sheared and mirrored bones.
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

/// Real part and dual part of (R, t).
const RIGID_PARTS: usize = 2;
/// The same and the dual part of (1, (L − R) v) as the columns of a matrix.
const AFFINE_PARTS: usize = 5;

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, posed: &mut [[f32; 3]]) {
    let bones: Vec<[Quaternion; AFFINE_PARTS]> = input.transforms.iter().map(dual_quaternion).collect();
    if bones.iter().all(|bone| bone[RIGID_PARTS..].iter().flatten().all(|x| x.abs() <= RIGID)) {
        blend_bones::<RIGID_PARTS>(&bones, input, posed);
    } else {
        blend_bones::<AFFINE_PARTS>(&bones, input, posed);
    }
}

fn blend_bones<const N: usize>(
    bones: &[[Quaternion; AFFINE_PARTS]],
    input: &SkinningInput,
    posed: &mut [[f32; 3]],
) {
    let single = |bone: &[Quaternion; AFFINE_PARTS]| std::array::from_fn(|k| bone[k].map(|x| x as f32));
    let bones: Vec<[[f32; 4]; N]> = bones.iter().map(single).collect();
    each_vertex(input, posed, |_, influences, v| moved(&bones, influences, v));
}

fn dual_quaternion(transform: &Transform) -> [Quaternion; AFFINE_PARTS] {
    let q = rotation_of(&transform.linear);
    let sheared: Matrix3 = transform.linear - matrix_of(q);
    let [x, y, z] = [0, 1, 2].map(|column| dual_of(q, sheared.column(column).into()));
    [q, dual_of(q, transform.translation), x, y, z]
}

/// ½ t q.
fn dual_of([x, y, z, w]: Quaternion, t: Point) -> Quaternion {
    let u = Point::new(x, y, z);
    let vector = (t * w + t.cross(&u)) / 2.0;
    [vector.x, vector.y, vector.z, -t.dot(&u) / 2.0]
}

/// v′ of one vertex.
#[inline]
fn moved<const N: usize>(bones: &[[[f32; 4]; N]], influences: &[(u32, f32)], v: [f32; 3]) -> [f32; 3] {
    let Some(&(pivot, _)) = influences.first() else { return v };
    let pivot = &bones[pivot as usize][0];
    let mut blend = [[0.0f32; 4]; N];
    let mut lack = 1.0f32;
    for &(joint, weight) in influences {
        let bone = &bones[joint as usize];
        lack -= weight;
        add_weighted(&mut blend, toward(pivot, &bone[0], weight), bone);
    }
    if lack > COMPLETE {
        blend[0][3] += lack.copysign(pivot[3]);
    }
    let mut dual = blend[1];
    for (column, x) in blend[RIGID_PARTS..].iter().zip(v) {
        dual.iter_mut().zip(column).for_each(|(sum, d)| *sum += d * x);
    }
    let (q, d) = (blend[0], dual);
    let (u, w) = ([q[0], q[1], q[2]], q[3]);
    let turned = cross(u, v);
    // u × (u × v + w v + d_u) in one product.
    let inner = cross(u, std::array::from_fn(|k| turned[k] + w * v[k] + d[k]));
    let scale = 2.0 / squared(q);
    std::array::from_fn(|k| v[k] + scale * (inner[k] + w * d[k] - d[3] * u[k]))
}

/// Adds `weight` times the parts of a bone.
#[inline]
pub(super) fn add_weighted<const N: usize>(sum: &mut [[f32; 4]; N], weight: f32, bone: &[[f32; 4]; N]) {
    for (sum, part) in sum.iter_mut().zip(bone) {
        sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += weight * x);
    }
}

#[inline]
pub(super) fn squared(q: [f32; 4]) -> f32 {
    q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
}

/// `weight` with the sign that brings quaternion `q` to the half of the sphere of `pivot`.
#[inline]
pub(super) fn toward(pivot: &[f32; 4], q: &[f32; 4], weight: f32) -> f32 {
    weight.copysign(q[0] * pivot[0] + q[1] * pivot[1] + q[2] * pivot[2] + q[3] * pivot[3])
}

#[inline]
pub(super) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
