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
//! Signs of quaternions and what the weights lack to 1: as in `dqs.rs`. Cost: 32 numbers per
//! influence, 16 where no bone scales.

use super::blocks::{each_vertex, Mover, Row};
use super::lbs::displacement;
use super::scratch::{Scratch, Turn};
use super::vectors::{add, affine, cross, scaled, squared, subtract, Three};
use super::SkinningInput;
use crate::points::Transform;
use crate::simd::Lanes;

/// Where the quaternion is.
const TURN: usize = 3;
/// Where S − I begins.
const SCALE: usize = 4;

/// M′ of a frame, in single precision.
pub fn pose(input: &SkinningInput, scratch: &mut Scratch, posed: &mut [[f32; 3]]) {
    let pairs = input.weights.pairs();
    if scratch.turn(input.transforms) {
        let table = scratch.paired(pairs, TURN..TURN + 1, input.transforms, rigid);
        each_vertex(Rigid, table, input, posed);
    } else {
        let table = scratch.paired(pairs, TURN..TURN + 1, input.transforms, stretched);
        each_vertex(Stretched, table, input, posed);
    }
}

/// L − I and t by rows, and the quaternion.
fn rigid(turn: &Turn, transform: &Transform) -> Row<4> {
    let [x, y, z, _] = displacement(transform);
    [x, y, z, turn.quaternion.map(|x| x as f32)]
}

/// The same and the rows of S − I.
fn stretched(turn: &Turn, transform: &Transform) -> Row<8> {
    let stretch = turn.matrix().transpose() * turn.rest;
    let symmetric = (stretch + stretch.transpose()) / 2.0;
    let mut row = [[0.0; 4]; 8];
    row[..SCALE].copy_from_slice(&rigid(turn, transform));
    for d in 0..3 {
        (0..3).for_each(|k| row[SCALE + d][k] = symmetric[(d, k)] as f32);
    }
    row
}

#[derive(Clone, Copy)]
struct Rigid;

impl Mover<4> for Rigid {
    const PAIRS: bool = true;
    const CENTERS: bool = true;

    #[inline(always)]
    fn moved<L: Lanes>(lanes: L, rows: &[Row<4>], v: Three<L>, p: Three<L>) -> Three<L> {
        let matrix = [lanes.columns(rows, 0), lanes.columns(rows, 1), lanes.columns(rows, 2)];
        let carried = affine(lanes, matrix, p);
        moved(lanes, lanes.columns(rows, TURN), carried, subtract(lanes, v, p), v)
    }
}

#[derive(Clone, Copy)]
struct Stretched;

impl Mover<8> for Stretched {
    const PAIRS: bool = true;
    const CENTERS: bool = true;

    #[inline(always)]
    fn moved<L: Lanes>(lanes: L, rows: &[Row<8>], v: Three<L>, p: Three<L>) -> Three<L> {
        let arm = subtract(lanes, v, p);
        let scale =
            [lanes.columns(rows, SCALE), lanes.columns(rows, SCALE + 1), lanes.columns(rows, SCALE + 2)];
        let stretch = affine(lanes, scale, arm);
        let matrix = [lanes.columns(rows, 0), lanes.columns(rows, 1), lanes.columns(rows, 2)];
        let carried = add(lanes, affine(lanes, matrix, p), stretch);
        moved(lanes, lanes.columns(rows, TURN), carried, add(lanes, arm, stretch), v)
    }
}

/// v′ as a displacement, exact at rest: `arm` (from the center) turns by q, `carried` is the rest.
#[inline(always)]
fn moved<L: Lanes>(lanes: L, q: [L::f32s; 4], carried: Three<L>, arm: Three<L>, v: Three<L>) -> Three<L> {
    let u = [q[0], q[1], q[2]];
    let inner = cross(lanes, u, scaled(lanes, q[3], arm, cross(lanes, u, arm)));
    let scale = lanes.div_f32s(lanes.splat_f32s(2.0), squared(lanes, q));
    add(lanes, v, scaled(lanes, scale, inner, carried))
}
