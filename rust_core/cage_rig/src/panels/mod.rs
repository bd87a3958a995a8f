//! A matrix laid out for products with points: Φ and Λ as frames read them.
//!
//! Rows lie in panels of 32, a panel column by column: one product is one walk through memory, with the
//! sums of a panel in registers, and what they are added to lies as they do ([`Apart`]). Products are
//! steps from known points: only columns that move are read, and no movement is exact. Cost: three
//! multiply-adds a number read, by far the largest product of a frame; large ones are as fast as memory,
//! small ones as the multipliers. Bakes, which know their frames in advance, make four of them of one walk.

mod apart;
mod strips;
#[cfg(test)]
mod tests;

use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use crate::simd::{Kernel, Lanes, Path};
pub(crate) use apart::Apart;
use rayon::prelude::*;
use strips::{halves, pack_half, pack_single, singles, Half, Single, Strips};

/// Rows of a panel.
const PANEL: usize = 32;
/// Below this many numbers one thread is faster than two.
const PARALLEL_FROM: usize = 1 << 20;
/// Panels that one thread takes at a time.
const SHARE: usize = 64;
/// Frames of one walk.
pub(crate) const FRAMES: usize = 4;

/// How numbers are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Single precision.
    #[default]
    Single,
    /// 16 bits, half of the memory: faster where the matrix is larger than the caches.
    Half,
}

/// `#rows by #columns`.
#[derive(Debug, Clone)]
pub(crate) struct Panels {
    columns: usize,
    numbers: Numbers,
}

#[derive(Debug, Clone)]
enum Numbers {
    Single(Vec<Single>),
    Half(Vec<Half>, Vec<f32>),
}

/// A column that moves, and how far in each of some frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<const F: usize = 1> {
    pub(crate) column: usize,
    pub(crate) by: [[f32; 3]; F],
}

/// What a product is added to, and by how much each row takes part in it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Product<'a> {
    /// The instructions to use.
    pub(crate) path: Path,
    /// `#rows by 3`.
    pub(crate) from: &'a Apart,
    /// `#rows`; none: 1.
    pub(crate) mask: Option<&'a [f32]>,
    /// `#rows by 3`, added at the end.
    pub(crate) offsets: Option<&'a [[f32; 3]]>,
}

impl Panels {
    /// Packs `matrix`.
    pub(crate) fn new(matrix: &Rows, precision: Precision, part: &Part) -> Result<Self, Cancelled> {
        let (rows, columns) = (matrix.len(), matrix.columns());
        let (panels, shares) = (rows.div_ceil(PANEL), part.count(rows.div_ceil(PANEL)));
        let of = |panel: usize| panel * PANEL..rows.min((panel + 1) * PANEL);
        let numbers = match precision {
            Precision::Single => {
                let mut strips = singles(panels * columns);
                strips.par_chunks_mut(columns.max(1)).enumerate().try_for_each(|(panel, strips)| {
                    pack_single(matrix, of(panel), strips);
                    shares.step(1)
                })?;
                Numbers::Single(strips)
            }
            Precision::Half => {
                let (mut strips, mut scales) = halves(panels * columns);
                let strips_of = strips.par_chunks_mut(columns.max(1));
                let both = strips_of.zip(scales.par_chunks_mut(columns.max(1)));
                both.enumerate().try_for_each(|(panel, (strips, scales))| {
                    pack_half(matrix, of(panel), strips, scales);
                    shares.step(1)
                })?;
                Numbers::Half(strips, scales)
            }
        };
        Ok(Self { columns, numbers })
    }

    /// The columns named by `chosen`, in that order.
    pub(crate) fn select(&self, chosen: &[usize]) -> Self {
        fn of<T: Copy>(strips: &[T], columns: usize, chosen: &[usize]) -> Vec<T> {
            let panels = strips.chunks_exact(columns.max(1));
            panels.flat_map(|panel| chosen.iter().map(|&k| panel[k])).collect()
        }
        let numbers = match &self.numbers {
            Numbers::Single(strips) => Numbers::Single(of(strips, self.columns, chosen)),
            Numbers::Half(strips, scales) => {
                Numbers::Half(of(strips, self.columns, chosen), of(scales, self.columns, chosen))
            }
        };
        Self { columns: chosen.len(), numbers }
    }

    /// Writes `from` + mask · (matrix · `steps`) + offsets, `#rows by 3`.
    pub(crate) fn write(&self, product: &Product, steps: &[Step], out: &mut [[f32; 3]]) {
        if out.len() * steps.len() < PARALLEL_FROM {
            product.path.run(Write { panels: self, product, first: 0, steps, out: [out] });
            return;
        }
        out.par_chunks_mut(SHARE * PANEL).enumerate().for_each(|(share, out)| {
            let first = share * SHARE * PANEL;
            product.path.run(Write { panels: self, product, first, steps, out: [out] });
        });
    }

    /// The same for several frames at once.
    pub(crate) fn write_frames(
        &self,
        product: &Product,
        steps: &[Step<FRAMES>],
        [a, b, c, d]: [&mut [[f32; 3]]; FRAMES],
    ) {
        if a.len() * steps.len() * FRAMES < PARALLEL_FROM {
            product.path.run(Write { panels: self, product, first: 0, steps, out: [a, b, c, d] });
            return;
        }
        let rows = SHARE * PANEL;
        let ab = a.par_chunks_mut(rows).zip(b.par_chunks_mut(rows));
        let cd = c.par_chunks_mut(rows).zip(d.par_chunks_mut(rows));
        ab.zip(cd).enumerate().for_each(|(share, ((a, b), (c, d)))| {
            let first = share * rows;
            product.path.run(Write { panels: self, product, first, steps, out: [a, b, c, d] });
        });
    }
}

/// Rows of a product from row `first` on, the first of a panel.
struct Write<'a, const F: usize> {
    panels: &'a Panels,
    product: &'a Product<'a>,
    first: usize,
    steps: &'a [Step<F>],
    out: [&'a mut [[f32; 3]]; F],
}

impl<const F: usize> Kernel for Write<'_, F> {
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (columns, panel) = (self.panels.columns, self.first / PANEL);
        match &self.panels.numbers {
            Numbers::Single(strips) => self.of(lanes, |p| &strips[(panel + p) * columns..][..columns]),
            Numbers::Half(strips, scales) => self.of(lanes, |p| {
                let of = (panel + p) * columns;
                (&strips[of..][..columns], &scales[of..][..columns])
            }),
        }
    }
}

impl<const F: usize> Write<'_, F> {
    #[inline(always)]
    fn of<L: Lanes, S: Strips>(self, lanes: L, panel: impl Fn(usize) -> S) {
        let Self { product, first, steps, mut out, .. } = self;
        for (p, start) in (0..out[0].len()).step_by(PANEL).enumerate() {
            let (strips, row) = (panel(p), first + start);
            let count = PANEL.min(out[0].len() - start);
            let from = product.from.panel(row / PANEL);
            let mut padded = [0.0; PANEL];
            let mask = product.mask.map(|mask| match &mask[row..row + count] {
                mask if count == PANEL => mask,
                mask => {
                    padded[..count].copy_from_slice(mask);
                    &padded
                }
            });
            for (f, out) in out.iter_mut().enumerate() {
                // After the first frame the panel is in the first cache.
                let moves = Moves { strips, steps, f, from, mask };
                let out = &mut out[start..start + count];
                if count == PANEL {
                    moves.rows(lanes, out);
                } else {
                    let mut last = [[0.0; 3]; PANEL];
                    moves.rows(lanes, &mut last);
                    out.copy_from_slice(&last[..count]);
                }
                if let Some(offsets) = product.offsets {
                    for (x, offset) in out.as_flattened_mut().iter_mut().zip(offsets[row..].as_flattened()) {
                        *x += offset;
                    }
                }
            }
        }
    }
}

/// What rows of a panel are made of in frame `f`.
struct Moves<'a, S, const F: usize> {
    strips: S,
    steps: &'a [Step<F>],
    f: usize,
    from: &'a [Single; 3],
    mask: Option<&'a [f32]>,
}

impl<S: Strips, const F: usize> Moves<'_, S, F> {
    #[inline(always)]
    fn rows<L: Lanes>(&self, lanes: L, out: &mut [[f32; 3]]) {
        // As many sums at once as there are registers for.
        match L::F32_LANES {
            16 => self.vectors::<L, 2>(lanes, out.as_flattened_mut()),
            _ => self.vectors::<L, 4>(lanes, out.as_flattened_mut()),
        }
    }

    /// `V` vectors of rows at a time.
    #[inline(always)]
    fn vectors<L: Lanes, const V: usize>(&self, lanes: L, out: &mut [f32]) {
        let Self { strips, steps, f, from, mask } = *self;
        for at in (0..PANEL).step_by(V * L::F32_LANES) {
            let zero = [lanes.splat_f32s(0.0); V];
            let (mut x, mut y, mut z) = (zero, zero, zero);
            for step in steps {
                let (strip, [dx, dy, dz]) = (strips.strip(step.column), step.by[f]);
                let dx = lanes.splat_f32s(S::scaled(&strip, dx));
                let dy = lanes.splat_f32s(S::scaled(&strip, dy));
                let dz = lanes.splat_f32s(S::scaled(&strip, dz));
                for v in 0..V {
                    let numbers = S::load(lanes, &strip, at + v * L::F32_LANES);
                    x[v] = lanes.fused(numbers, dx, x[v]);
                    y[v] = lanes.fused(numbers, dy, y[v]);
                    z[v] = lanes.fused(numbers, dz, z[v]);
                }
            }
            for v in 0..V {
                let row = at + v * L::F32_LANES;
                if let Some(mask) = mask {
                    let part = lanes.load(&mask[row..]);
                    x[v] = lanes.mul_f32s(x[v], part);
                    y[v] = lanes.mul_f32s(y[v], part);
                    z[v] = lanes.mul_f32s(z[v], part);
                }
                x[v] = lanes.add_f32s(lanes.load(&from[0].0[row..]), x[v]);
                y[v] = lanes.add_f32s(lanes.load(&from[1].0[row..]), y[v]);
                z[v] = lanes.add_f32s(lanes.load(&from[2].0[row..]), z[v]);
                lanes.store_points(&mut out[3 * row..], [x[v], y[v], z[v]]);
            }
        }
    }
}
