//! Panels in single precision.

use super::{Moves, Step, PANEL};
use crate::rows::Rows;
use crate::simd::{Lanes, Vector};
use std::ops::Range;

/// One column of a panel, a whole number of cache lines.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub(super) struct Single(pub(super) [f32; PANEL]);

impl Single {
    pub(super) const ZERO: Self = Self([0.0; PANEL]);
}

/// Packs `rows` of `matrix`, at most those of one panel.
pub(super) fn pack(matrix: &Rows, rows: Range<usize>, strips: &mut [Single]) {
    for (r, i) in rows.enumerate() {
        strips.iter_mut().zip(matrix.row(i)).for_each(|(strip, x)| strip.0[r] = *x as f32);
    }
}

/// A panel and what moves in frame `f`.
pub(super) struct SingleMoves<'a, const F: usize> {
    pub(super) strips: &'a [Single],
    pub(super) steps: &'a [Step<F>],
    pub(super) f: usize,
}

impl<const F: usize> Moves for SingleMoves<'_, F> {
    const AT_ONCE: usize = 4;

    #[inline(always)]
    fn sums<L: Lanes, const V: usize>(&self, lanes: L, at: usize) -> [[Vector<L>; V]; 3] {
        let zero = [lanes.splat_f32s(0.0); V];
        let (mut x, mut y, mut z) = (zero, zero, zero);
        for step in self.steps {
            let (strip, [dx, dy, dz]) = (&self.strips[step.column].0, step.by[self.f]);
            let (dx, dy, dz) = (lanes.splat_f32s(dx), lanes.splat_f32s(dy), lanes.splat_f32s(dz));
            for v in 0..V {
                let numbers = lanes.load(&strip[at + v * L::F32_LANES..]);
                x[v] = lanes.fused(numbers, dx, x[v]);
                y[v] = lanes.fused(numbers, dy, y[v]);
                z[v] = lanes.fused(numbers, dz, z[v]);
            }
        }
        [x, y, z]
    }
}
