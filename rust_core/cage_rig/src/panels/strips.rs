//! What panels are made of: columns of 32 rows, in single precision or in 16 bits.
//!
//! In 16 bits a column of a panel has a scale of its own, so that small numbers keep their digits, and
//! what rounding takes from a number is given to the next one of its row: rows keep their sums, and what
//! moves as a whole stays whole.

use super::PANEL;
use crate::rows::Rows;
use crate::simd::Lanes;
use std::ops::Range;

/// The columns of one panel.
pub(super) trait Strips: Copy {
    type Strip;

    fn strip(self, column: usize) -> Self::Strip;

    /// What the numbers of `strip` are to be multiplied by, times `by`.
    fn scaled(strip: &Self::Strip, by: f32) -> f32;

    /// Rows from `at` on.
    fn load<L: Lanes>(lanes: L, strip: &Self::Strip, at: usize) -> L::f32s;
}

/// One column of a panel, a whole number of cache lines.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub(super) struct Single(pub(super) [f32; PANEL]);

/// The same in 16 bits.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Half([i16; PANEL]);

impl Single {
    pub(super) const ZERO: Self = Self([0.0; PANEL]);
}

impl<'a> Strips for &'a [Single] {
    type Strip = &'a Single;

    #[inline(always)]
    fn strip(self, column: usize) -> &'a Single {
        &self[column]
    }

    #[inline(always)]
    fn scaled(_: &Self::Strip, by: f32) -> f32 {
        by
    }

    #[inline(always)]
    fn load<L: Lanes>(lanes: L, strip: &Self::Strip, at: usize) -> L::f32s {
        lanes.load(&strip.0[at..])
    }
}

impl<'a> Strips for (&'a [Half], &'a [f32]) {
    type Strip = (&'a Half, f32);

    #[inline(always)]
    fn strip(self, column: usize) -> Self::Strip {
        (&self.0[column], self.1[column])
    }

    #[inline(always)]
    fn scaled((_, scale): &Self::Strip, by: f32) -> f32 {
        scale * by
    }

    #[inline(always)]
    fn load<L: Lanes>(lanes: L, (strip, _): &Self::Strip, at: usize) -> L::f32s {
        lanes.load_i16(&strip.0[at..])
    }
}

/// Strips of zeros.
pub(super) fn singles(count: usize) -> Vec<Single> {
    vec![Single::ZERO; count]
}

/// Strips of zeros and their scales.
pub(super) fn halves(count: usize) -> (Vec<Half>, Vec<f32>) {
    (vec![Half([0; PANEL]); count], vec![0.0; count])
}

/// Packs `rows` of `matrix`, at most those of one panel.
pub(super) fn pack_single(matrix: &Rows, rows: Range<usize>, strips: &mut [Single]) {
    for (r, i) in rows.enumerate() {
        strips.iter_mut().zip(matrix.row(i)).for_each(|(strip, x)| strip.0[r] = *x as f32);
    }
}

/// The same in 16 bits.
pub(super) fn pack_half(matrix: &Rows, rows: Range<usize>, strips: &mut [Half], scales: &mut [f32]) {
    for (column, scale) in scales.iter_mut().enumerate() {
        let largest = rows.clone().map(|i| matrix.row(i)[column].abs()).fold(0.0, f64::max);
        *scale = (largest / f64::from(i16::MAX)) as f32;
    }
    for (r, i) in rows.enumerate() {
        let mut left = 0.0;
        for ((strip, scale), x) in strips.iter_mut().zip(&*scales).zip(matrix.row(i)) {
            let scale = f64::from(*scale);
            if scale > 0.0 {
                // Out of range it saturates, and the rest goes on to the next number.
                strip.0[r] = ((x + left) / scale).round() as i16;
                left += x - f64::from(strip.0[r]) * scale;
            }
        }
    }
}
