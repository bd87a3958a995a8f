//! Skinning about optimized centers of rotation: neither the collapse of linear blending nor the
//! bulge of dual quaternions.
//!
//! Based on [LH16], Eq. (5–6) of [CTL*20]: vertex i turns rigidly by R(i), the blend of the bones'
//! quaternions, about its center p_i, and the center moves by linear blending:
//! v′ = R(i) v + t(i), t(i) = Σ_j ω_ij (R_j p_i + t_j) − R(i) p_i. See `centers.rs` for p.
//!
//! Two phases where bones scale or shear, T_j = R_j S_j (polar): the scales, which act on v − p_i and
//! so need no origin, blend linearly, and then R(i) turns: v′ = R(i) Σ_j ω_ij S_j (v − p_i) +
//! Σ_j ω_ij T_j(p_i). A vertex of one bone goes where the bone takes it, whatever its center.
//!
//! Signs of quaternions and what the weights lack to 1: as in `dqs.rs`. Cost: 28 numbers per
//! influence.

use super::dqs::{add_weighted, cross, squared, toward, COMPLETE};
use super::rotation::{matrix_of, rotation_of};
use super::{each_vertex, SkinningInput};
use crate::points::{Matrix3, Transform};

/// Quaternion; then by columns, four numbers each: S − I with one number of t, L − I padded.
type Bone = ([f32; 4], [[f32; 4]; 6]);

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, posed: &mut [[f32; 3]]) {
    let bones: Vec<Bone> = input.transforms.iter().map(motion).collect();
    each_vertex(input, posed, |i, influences, v| moved(&bones, influences, v, input.centers[i]));
}

fn motion(transform: &Transform) -> Bone {
    let q = rotation_of(&transform.linear);
    let stretch = matrix_of(q).transpose() * transform.linear;
    let scale = (stretch + stretch.transpose()) / 2.0 - Matrix3::identity();
    let linear = transform.linear - Matrix3::identity();
    let column = |matrix: &Matrix3, k: usize, last: f64| {
        [matrix[(0, k)], matrix[(1, k)], matrix[(2, k)], last].map(|x| x as f32)
    };
    let parts = std::array::from_fn(|k| match k {
        0..3 => column(&scale, k, transform.translation[k]),
        _ => column(&linear, k - 3, 0.0),
    });
    (q.map(|x| x as f32), parts)
}

/// v′ of one vertex with center p, as a displacement: exact at rest.
#[inline]
fn moved(bones: &[Bone], influences: &[(u32, f32)], v: [f32; 3], p: [f32; 3]) -> [f32; 3] {
    let Some(&(pivot, _)) = influences.first() else { return v };
    let pivot = &bones[pivot as usize].0;
    let mut q = [[0.0f32; 4]];
    let mut blend = [[0.0f32; 4]; 6];
    let mut lack = 1.0f32;
    for &(joint, weight) in influences {
        let (turn, parts) = &bones[joint as usize];
        lack -= weight;
        add_weighted(&mut q, toward(pivot, turn, weight), &[*turn]);
        add_weighted(&mut blend, weight, parts);
    }
    let [mut q] = q;
    if lack > COMPLETE {
        q[3] += lack.copysign(pivot[3]);
    }
    let d: [f32; 3] = std::array::from_fn(|k| v[k] - p[k]);
    let along = |columns: &[[f32; 4]], x: [f32; 3], k: usize| {
        columns[0][k] * x[0] + columns[1][k] * x[1] + columns[2][k] * x[2]
    };
    let stretch: [f32; 3] = std::array::from_fn(|k| along(&blend[..3], d, k));
    let e: [f32; 3] = std::array::from_fn(|k| d[k] + stretch[k]);
    let (u, w) = ([q[0], q[1], q[2]], q[3]);
    let turned = cross(u, e);
    let inner = cross(u, std::array::from_fn(|k| turned[k] + w * e[k]));
    let scale = 2.0 / squared(q);
    std::array::from_fn(|k| {
        let carried = along(&blend[3..], p, k) + blend[k][3];
        v[k] + (carried + stretch[k] + scale * inner[k])
    })
}
