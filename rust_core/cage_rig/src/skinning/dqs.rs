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
//! Cost: 24 numbers per influence, 8 where no bone scales.

use super::blocks::{each_vertex, Mover, Row};
use super::scratch::{Scratch, Turn};
use super::vectors::{add, cross, scaled, squared, Three};
use super::SkinningInput;
use crate::points::{Point, Transform};
use crate::simd::Lanes;

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, scratch: &mut Scratch, posed: &mut [[f32; 3]]) {
    let pairs = input.weights.pairs();
    if scratch.turn(input.transforms) {
        let table = scratch.paired(pairs, 0..2, input.transforms, |turn, transform| {
            let [q, d, ..] = dual_quaternion(turn, transform);
            [q, d]
        });
        each_vertex(Rigid, table, input, posed);
    } else {
        let table = scratch.paired(pairs, 0..6, input.transforms, dual_quaternion);
        each_vertex(Affine, table, input, posed);
    }
}

/// Real part, dual part of (R, t), and that of (1, (L − R) v) as the columns of a matrix.
fn dual_quaternion(turn: &Turn, transform: &Transform) -> Row<6> {
    let q = turn.quaternion;
    let [x, y, z] = [0, 1, 2].map(|column| dual_of(q, turn.rest.column(column).into()));
    [q, dual_of(q, transform.translation), x, y, z, [0.0; 4]].map(|part| part.map(|x| x as f32))
}

/// ½ t q.
fn dual_of([x, y, z, w]: [f64; 4], t: Point) -> [f64; 4] {
    let u = Point::new(x, y, z);
    let vector = (t * w + t.cross(&u)) / 2.0;
    [vector.x, vector.y, vector.z, -t.dot(&u) / 2.0]
}

#[derive(Clone, Copy)]
struct Rigid;

impl Mover<2> for Rigid {
    const PAIRS: bool = true;
    const CENTERS: bool = false;

    #[inline(always)]
    fn moved<L: Lanes>(lanes: L, rows: &[Row<2>], v: Three<L>, _: Three<L>) -> Three<L> {
        moved(lanes, lanes.columns(rows, 0), lanes.columns(rows, 1), v)
    }
}

#[derive(Clone, Copy)]
struct Affine;

impl Mover<6> for Affine {
    const PAIRS: bool = true;
    const CENTERS: bool = false;

    #[inline(always)]
    fn moved<L: Lanes>(lanes: L, rows: &[Row<6>], v: Three<L>, _: Three<L>) -> Three<L> {
        let mut dual = lanes.columns(rows, 1);
        for (column, x) in v.into_iter().enumerate() {
            let part = lanes.columns(rows, 2 + column);
            for k in 0..4 {
                dual[k] = lanes.fused(part[k], x, dual[k]);
            }
        }
        moved(lanes, lanes.columns(rows, 0), dual, v)
    }
}

/// v′ under the blended real part q and dual part d.
#[inline(always)]
fn moved<L: Lanes>(lanes: L, q: [L::f32s; 4], d: [L::f32s; 4], v: Three<L>) -> Three<L> {
    let u = [q[0], q[1], q[2]];
    // u × (u × v + w v + d_u) in one product.
    let inner = add(lanes, cross(lanes, u, v), scaled(lanes, q[3], v, [d[0], d[1], d[2]]));
    let turned = cross(lanes, u, inner);
    let along = scaled(lanes, q[3], [d[0], d[1], d[2]], turned);
    let step = scaled(lanes, lanes.neg_f32s(d[3]), u, along);
    let scale = lanes.div_f32s(lanes.splat_f32s(2.0), squared(lanes, q));
    scaled(lanes, scale, step, v)
}
