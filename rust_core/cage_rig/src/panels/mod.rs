//! A matrix laid out for products with points: Φ and Λ as frames read them.
//!
//! Rows lie in panels of 32, a panel column by column: one product is one walk through memory, with the
//! sums of a panel in registers, and what they are added to lies as they do ([`Apart`]). Products are
//! steps from known points: only columns that move are read, and no movement is exact. Cost: three
//! multiply-adds a number read, by far the largest product of a frame; large ones are as fast as memory,
//! small ones as the multipliers. Bakes, which know their frames in advance, make four of them of one walk.

mod apart;
mod halves;
mod shapes;
mod singles;
#[cfg(test)]
mod tests;

use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use crate::simd::{Kernel, Lanes, Path, Vector};
use crate::threads;
pub(crate) use apart::Apart;
use halves::{Half, HalfMoves, Pair};
use rayon::prelude::*;
use shapes::ShapeMoves;
use singles::{Single, SingleMoves};

/// Rows of a panel.
const PANEL: usize = 32;
/// Below this many numbers one thread is faster than two; each further one needs as many.
const PARALLEL_FROM: usize = 3 << 18;
/// Panels that one thread takes at a time.
const SHARE: usize = 16;
/// Frames of one walk.
pub(crate) const FRAMES: usize = 4;

/// How numbers are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Single precision.
    #[default]
    Single,
    /// 16 bits, half of the memory and fewer instructions; errors below 2e-4 of the movement.
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
    /// Two columns a strip, and the scales of panels.
    Half(Vec<Half>, Vec<f32>),
}

/// What a product multiplies.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Factor<'a> {
    Panels(&'a Panels),
    /// Columns of points: three numbers a row, one for each of the three of a step.
    Shapes(&'a [Apart]),
}

/// A column that moves, and how far in each of some frames.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<const F: usize = 1> {
    pub(crate) column: usize,
    pub(crate) by: [[f32; 3]; F],
}

/// What moves, in memory that products use again.
#[derive(Debug, Clone)]
pub(crate) struct Steps<const F: usize = 1> {
    moved: Vec<Step<F>>,
    /// The same for panels in 16 bits, and what it is multiples of.
    pairs: Vec<Pair<F>>,
    units: [[f32; 3]; F],
}

impl<const F: usize> Default for Steps<F> {
    fn default() -> Self {
        Self { moved: Vec::new(), pairs: Vec::new(), units: [[0.0; 3]; F] }
    }
}

impl<const F: usize> Steps<F> {
    /// Takes what moves now in the place of what did.
    pub(crate) fn set(&mut self, moved: impl Iterator<Item = Step<F>>) {
        self.moved.clear();
        self.moved.extend(moved);
    }
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
                let mut strips = vec![Single::ZERO; panels * columns];
                strips.par_chunks_mut(columns.max(1)).enumerate().try_for_each(|(panel, strips)| {
                    singles::pack(matrix, of(panel), strips);
                    shares.step(1)
                })?;
                Numbers::Single(strips)
            }
            Precision::Half => {
                let pairs = columns.div_ceil(2);
                let (mut strips, mut scales) = (vec![Half::ZERO; panels * pairs], vec![0.0; panels]);
                let both = strips.par_chunks_mut(pairs.max(1)).zip(&mut scales);
                both.enumerate().try_for_each(|(panel, (strips, scale))| {
                    *scale = halves::pack(matrix, of(panel), strips);
                    shares.step(1)
                })?;
                Numbers::Half(strips, scales)
            }
        };
        Ok(Self { columns, numbers })
    }

    pub(crate) fn precision(&self) -> Precision {
        match self.numbers {
            Numbers::Single(..) => Precision::Single,
            Numbers::Half(..) => Precision::Half,
        }
    }

    /// The columns named by `chosen`, in that order.
    pub(crate) fn select(&self, chosen: &[usize]) -> Self {
        let numbers = match &self.numbers {
            Numbers::Single(strips) => {
                let panels = strips.chunks_exact(self.columns.max(1));
                Numbers::Single(panels.flat_map(|panel| chosen.iter().map(|&k| panel[k])).collect())
            }
            Numbers::Half(strips, scales) => {
                let panels = strips.chunks_exact(self.columns.div_ceil(2).max(1));
                let strips = panels.flat_map(|panel| halves::select(panel, chosen)).collect();
                Numbers::Half(strips, scales.clone())
            }
        };
        Self { columns: chosen.len(), numbers }
    }

    /// Writes `from` + mask · (matrix · `steps`) + offsets, `#rows by 3`.
    pub(crate) fn write(&self, product: &Product, steps: &mut Steps, out: &mut [[f32; 3]]) {
        Factor::Panels(self).write(product, steps, out);
    }

    /// The same for several frames at once.
    pub(crate) fn write_frames(
        &self,
        product: &Product,
        steps: &mut Steps<FRAMES>,
        [a, b, c, d]: [&mut [[f32; 3]]; FRAMES],
    ) {
        let (factor, steps) = (Factor::Panels(self), self.rounded(steps));
        if a.len() * steps.moved.len() * FRAMES < PARALLEL_FROM {
            product.path.run(Write { factor, product, first: 0, steps, out: [a, b, c, d] });
            return;
        }
        let rows = SHARE * PANEL;
        let ab = a.par_chunks_mut(rows).zip(b.par_chunks_mut(rows));
        let cd = c.par_chunks_mut(rows).zip(d.par_chunks_mut(rows));
        ab.zip(cd).enumerate().for_each(|(share, ((a, b), (c, d)))| {
            let first = share * rows;
            product.path.run(Write { factor, product, first, steps, out: [a, b, c, d] });
        });
    }

    fn rounded<'a, const F: usize>(&self, steps: &'a mut Steps<F>) -> &'a Steps<F> {
        if self.precision() == Precision::Half {
            steps.units = halves::round(&steps.moved, &mut steps.pairs);
        }
        steps
    }
}

impl Factor<'_> {
    /// Writes `from` + mask · (matrix · `steps`) + offsets, `#rows by 3`.
    pub(crate) fn write(self, product: &Product, steps: &mut Steps, out: &mut [[f32; 3]]) {
        let (steps, width) = match self {
            Self::Panels(panels) => {
                let steps = panels.rounded(steps);
                (steps, steps.moved.len())
            }
            // Where few columns are read, what they are added to counts.
            Self::Shapes(_) => (&*steps, 3 * steps.moved.len() + 6),
        };
        let numbers = out.len() * width;
        if numbers < PARALLEL_FROM {
            product.path.run(Write { factor: self, product, first: 0, steps, out: [out] });
            return;
        }
        let shares = out.chunks_mut(SHARE * PANEL).enumerate();
        threads::each(shares, numbers / PARALLEL_FROM, |(share, out)| {
            let first = share * SHARE * PANEL;
            product.path.run(Write { factor: self, product, first, steps, out: [out] });
        });
    }
}

/// Rows of a product from row `first` on, the first of a panel.
struct Write<'a, const F: usize> {
    factor: Factor<'a>,
    product: &'a Product<'a>,
    first: usize,
    steps: &'a Steps<F>,
    out: [&'a mut [[f32; 3]]; F],
}

impl<const F: usize> Kernel for Write<'_, F> {
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (first, steps) = (self.first / PANEL, self.steps);
        let Panels { columns, numbers } = match self.factor {
            Factor::Panels(panels) => panels,
            Factor::Shapes(columns) => {
                return self.of(lanes, |panel, f| {
                    let panel = first + panel;
                    ShapeMoves { columns, panel, steps: &steps.moved, f }
                })
            }
        };
        match numbers {
            Numbers::Single(strips) => self.of(lanes, |panel, f| {
                let strips = &strips[(first + panel) * columns..][..*columns];
                SingleMoves { strips, steps: &steps.moved, f }
            }),
            Numbers::Half(strips, scales) => self.of(lanes, |panel, f| {
                let pairs = columns.div_ceil(2);
                let (strips, scale) = (&strips[(first + panel) * pairs..][..pairs], scales[first + panel]);
                HalfMoves { strips, scale, pairs: &steps.pairs, units: &steps.units, f }
            }),
        }
    }
}

impl<const F: usize> Write<'_, F> {
    #[inline(always)]
    fn of<L: Lanes, M: Moves>(self, lanes: L, moves: impl Fn(usize, usize) -> M) {
        let Self { product, first, mut out, .. } = self;
        for (p, start) in (0..out[0].len()).step_by(PANEL).enumerate() {
            let row = first + start;
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
                let rows = PanelRows { moves: moves(p, f), from, mask };
                let out = &mut out[start..start + count];
                if count == PANEL {
                    rows.write(lanes, out);
                } else {
                    let mut last = [[0.0; 3]; PANEL];
                    rows.write(lanes, &mut last);
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

/// A panel times what moves.
trait Moves {
    /// As many vectors of rows at once as sixteen registers hold the sums of, beside what is multiplied.
    const AT_ONCE: usize;

    /// x, y and z of `V` vectors of rows from `at` on.
    fn sums<L: Lanes, const V: usize>(&self, lanes: L, at: usize) -> [[Vector<L>; V]; 3];
}

/// What rows of a panel are made of.
struct PanelRows<'a, M> {
    moves: M,
    from: &'a [Single; 3],
    mask: Option<&'a [f32]>,
}

impl<M: Moves> PanelRows<'_, M> {
    #[inline(always)]
    fn write<L: Lanes>(&self, lanes: L, out: &mut [[f32; 3]]) {
        match M::AT_ONCE.min(PANEL / L::F32_LANES) {
            2 => self.vectors::<L, 2>(lanes, out.as_flattened_mut()),
            _ => self.vectors::<L, 4>(lanes, out.as_flattened_mut()),
        }
    }

    /// `V` vectors of rows at a time.
    #[inline(always)]
    fn vectors<L: Lanes, const V: usize>(&self, lanes: L, out: &mut [f32]) {
        let Self { moves, from, mask } = self;
        for at in (0..PANEL).step_by(V * L::F32_LANES) {
            let [mut x, mut y, mut z] = moves.sums::<L, V>(lanes, at);
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
