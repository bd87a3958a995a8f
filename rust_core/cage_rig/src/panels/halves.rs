//! Panels in 16 bits: fixed point on both sides, and sums that are exact.
//!
//! Numbers are whole multiples of a scale that a panel has, movements of one that an axis has. Columns lie
//! in pairs, since one instruction multiplies two pairs of 16-bit numbers and adds the products: 16 numbers
//! of AVX2 cost two instructions a coordinate where single precision takes two as well, of half the memory,
//! and nothing is converted. What rounding takes from a number is given to the next one of its row: rows
//! keep their sums, and what moves as a whole stays whole.

use super::{Moves, Step, PANEL};
use crate::rows::Rows;
use crate::simd::{Lanes, Vector};
use std::ops::Range;

/// Largest number of 16 bits.
const LARGEST: f64 = i16::MAX as f64;
/// Magnitudes of a row add up to no more, or a sum of products could leave 32 bits.
const LARGEST_ROW: f64 = 65_500.0;

/// Two columns of a panel, side by side, a whole number of cache lines.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub(super) struct Half([i32; PANEL]);

impl Half {
    pub(super) const ZERO: Self = Self([0; PANEL]);
}

/// Two columns that move, and how far in each of some frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<const F: usize> {
    at: usize,
    by: [[i32; 3]; F],
}

/// Packs `rows` of `matrix`, at most those of one panel, and gives their scale.
pub(super) fn pack(matrix: &Rows, rows: Range<usize>, strips: &mut [Half]) -> f32 {
    let values = rows.clone().flat_map(|i| matrix.row(i));
    let number = values.map(|x| x.abs()).fold(0.0, f64::max);
    let row = rows.clone().map(|i| matrix.row(i).iter().map(|x| x.abs()).sum()).fold(0.0, f64::max);
    // Rounding adds at most one to every number of a row.
    let room = (LARGEST_ROW - matrix.columns() as f64).max(1.0);
    let scale = (number / LARGEST).max(row / room) as f32;
    if scale > 0.0 {
        for (r, i) in rows.enumerate() {
            let mut left = 0.0;
            for (column, x) in matrix.row(i).iter().enumerate() {
                let exact = x / f64::from(scale) + left;
                // Out of range it saturates, and the rest goes on to the next number.
                let whole = exact.round() as i16;
                left = exact - f64::from(whole);
                let number = &mut strips[column / 2].0[r];
                *number = put(*number, column, whole);
            }
        }
    }
    scale
}

/// The columns of one panel that are named by `chosen`, in that order.
pub(super) fn select<'a>(panel: &'a [Half], chosen: &'a [usize]) -> impl Iterator<Item = Half> + 'a {
    chosen.chunks(2).map(|pair| {
        let mut both = Half::ZERO;
        for (place, &column) in pair.iter().enumerate() {
            for (to, from) in both.0.iter_mut().zip(panel[column / 2].0) {
                *to = put(*to, place, of(from, column));
            }
        }
        both
    })
}

/// Rounds `steps`, and gives what they are multiples of.
pub(super) fn round<const F: usize>(steps: &[Step<F>], pairs: &mut Vec<Pair<F>>) -> [[f32; 3]; F] {
    let mut farthest = [[0.0f32; 3]; F];
    for step in steps {
        for (far, by) in farthest.as_flattened_mut().iter_mut().zip(step.by.as_flattened()) {
            *far = far.max(by.abs());
        }
    }
    pairs.clear();
    for step in steps {
        let at = step.column / 2;
        if pairs.last().is_none_or(|pair| pair.at != at) {
            pairs.push(Pair { at, by: [[0; 3]; F] });
        }
        let by = &mut pairs.last_mut().expect("one was pushed").by;
        let exact = step.by.as_flattened().iter().zip(farthest.as_flattened());
        for (rounded, (by, far)) in by.as_flattened_mut().iter_mut().zip(exact) {
            // No movement along an axis: 0 / 0 is no number, which becomes 0.
            let whole = (f64::from(*by) / f64::from(*far) * LARGEST).round() as i16;
            *rounded = put(*rounded, step.column, whole);
        }
    }
    farthest.map(|axes| axes.map(|far| (f64::from(far) / LARGEST) as f32))
}

/// `pair` with `number` in the place of `column`.
fn put(pair: i32, column: usize, number: i16) -> i32 {
    let shift = 16 * (column % 2);
    pair & !(0xffff << shift) | i32::from(number as u16) << shift
}

/// The number of `column`.
fn of(pair: i32, column: usize) -> i16 {
    (pair >> (16 * (column % 2))) as i16
}

/// A panel and what moves in frame `f`.
pub(super) struct HalfMoves<'a, const F: usize> {
    pub(super) strips: &'a [Half],
    pub(super) scale: f32,
    pub(super) pairs: &'a [Pair<F>],
    pub(super) units: &'a [[f32; 3]; F],
    pub(super) f: usize,
}

impl<const F: usize> Moves for HalfMoves<'_, F> {
    /// Products need a register before they are added.
    const AT_ONCE: usize = 2;

    #[inline(always)]
    fn sums<L: Lanes, const V: usize>(&self, lanes: L, at: usize) -> [[Vector<L>; V]; 3] {
        let zero = [lanes.splat_i32s(0); V];
        let (mut x, mut y, mut z) = (zero, zero, zero);
        for pair in self.pairs {
            let (strip, [dx, dy, dz]) = (&self.strips[pair.at].0, pair.by[self.f]);
            let (dx, dy, dz) = (lanes.splat_i32s(dx), lanes.splat_i32s(dy), lanes.splat_i32s(dz));
            for v in 0..V {
                let numbers = lanes.load_i32(&strip[at + v * L::F32_LANES..]);
                x[v] = lanes.add_pairs(numbers, dx, x[v]);
                y[v] = lanes.add_pairs(numbers, dy, y[v]);
                z[v] = lanes.add_pairs(numbers, dz, z[v]);
            }
        }
        let [ux, uy, uz] = self.units[self.f].map(|unit| lanes.splat_f32s(self.scale * unit));
        let mut sums = [[lanes.splat_f32s(0.0); V]; 3];
        for v in 0..V {
            sums[0][v] = lanes.mul_f32s(lanes.to_f32(x[v]), ux);
            sums[1][v] = lanes.mul_f32s(lanes.to_f32(y[v]), uy);
            sums[2][v] = lanes.mul_f32s(lanes.to_f32(z[v]), uz);
        }
        sums
    }
}
