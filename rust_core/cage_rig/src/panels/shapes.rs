//! Columns of points: what moves along a shape moves each row by a point of its own.

use super::{Apart, Moves, Step};
use crate::simd::{Lanes, Vector};

/// Panel `panel` of columns, and what moves in frame `f`.
pub(super) struct ShapeMoves<'a, const F: usize> {
    pub(super) columns: &'a [Apart],
    pub(super) panel: usize,
    pub(super) steps: &'a [Step<F>],
    pub(super) f: usize,
}

impl<const F: usize> Moves for ShapeMoves<'_, F> {
    const AT_ONCE: usize = 4;

    #[inline(always)]
    fn sums<L: Lanes, const V: usize>(&self, lanes: L, at: usize) -> [[Vector<L>; V]; 3] {
        let mut sums = [[lanes.splat_f32s(0.0); V]; 3];
        for step in self.steps {
            let points = self.columns[step.column].panel(self.panel);
            for (d, sums) in sums.iter_mut().enumerate() {
                let by = lanes.splat_f32s(step.by[self.f][d]);
                for (v, sum) in sums.iter_mut().enumerate() {
                    *sum = lanes.fused(lanes.load(&points[d].0[at + v * L::F32_LANES..]), by, *sum);
                }
            }
        }
        sums
    }
}
