//! Vectors in three dimensions, one a lane.

use crate::simd::{Lanes, Vector};

/// x, y, z.
pub(super) type Three<L> = [Vector<L>; 3];

/// a + b.
#[inline(always)]
pub(super) fn add<L: Lanes>(lanes: L, a: Three<L>, b: Three<L>) -> Three<L> {
    [lanes.add_f32s(a[0], b[0]), lanes.add_f32s(a[1], b[1]), lanes.add_f32s(a[2], b[2])]
}

/// a − b.
#[inline(always)]
pub(super) fn subtract<L: Lanes>(lanes: L, a: Three<L>, b: Three<L>) -> Three<L> {
    [lanes.sub_f32s(a[0], b[0]), lanes.sub_f32s(a[1], b[1]), lanes.sub_f32s(a[2], b[2])]
}

/// s a + b.
#[inline(always)]
pub(super) fn scaled<L: Lanes>(lanes: L, s: L::f32s, a: Three<L>, b: Three<L>) -> Three<L> {
    [lanes.fused(s, a[0], b[0]), lanes.fused(s, a[1], b[1]), lanes.fused(s, a[2], b[2])]
}

/// a × b.
#[inline(always)]
pub(super) fn cross<L: Lanes>(lanes: L, a: Three<L>, b: Three<L>) -> Three<L> {
    [minor(lanes, a, b, 1, 2), minor(lanes, a, b, 2, 0), minor(lanes, a, b, 0, 1)]
}

#[inline(always)]
fn minor<L: Lanes>(lanes: L, a: Three<L>, b: Three<L>, i: usize, j: usize) -> L::f32s {
    lanes.sub_f32s(lanes.mul_f32s(a[i], b[j]), lanes.mul_f32s(a[j], b[i]))
}

/// |q|².
#[inline(always)]
pub(super) fn squared<L: Lanes>(lanes: L, [x, y, z, w]: [L::f32s; 4]) -> L::f32s {
    lanes.fused(x, x, lanes.fused(y, y, lanes.fused(z, z, lanes.mul_f32s(w, w))))
}

/// m₀ v + t₀, m₁ v + t₁ and m₂ v + t₂ of rows (m, t).
#[inline(always)]
pub(super) fn affine<L: Lanes>(lanes: L, rows: [[L::f32s; 4]; 3], v: Three<L>) -> Three<L> {
    [line(lanes, rows[0], v), line(lanes, rows[1], v), line(lanes, rows[2], v)]
}

#[inline(always)]
fn line<L: Lanes>(lanes: L, [a, b, c, t]: [L::f32s; 4], v: Three<L>) -> L::f32s {
    lanes.fused(a, v[0], lanes.fused(b, v[1], lanes.fused(c, v[2], t)))
}
