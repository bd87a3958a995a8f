//! The rest skin under an edited cage, in the frame's single precision.
//!
//! [CTL*20] Eq. (7), M = Φ C, in delta form: M = M₀ + Φ (C − C₀). Exact at rest whatever rounding
//! is in Φ, and only the columns of cage vertices that moved cost anything: `#M` per moved vertex.

use crate::points::{to_f32, Point};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use rayon::prelude::*;

/// Rows worked on at once: three sums and a column piece stay in the first cache.
const PANEL: usize = 1024;
/// Below this many vertices one thread is faster than two.
const PARALLEL_FROM: usize = 8192;

/// M₀, C₀ and Φ, column by column.
#[derive(Debug, Clone)]
pub struct RestSkin {
    skin: Vec<[f32; 3]>,
    cage: Vec<Point>,
    columns: Vec<f32>,
}

impl RestSkin {
    /// Keeps `skin` (`#M by 3`) and `cage` (`#C by 3`) of the bind and `cage_coords`
    /// (`#M by #C`).
    pub fn new(skin: &[Point], cage: &[Point], cage_coords: &Rows, part: &Part) -> Result<Self, Cancelled> {
        let count = skin.len();
        let mut columns = vec![0.0; count * cage.len()];
        // Sixteen columns at a time: a row of Φ is read from memory once for all of them.
        let blocks = part.count(cage.len().div_ceil(16));
        columns.par_chunks_mut(16 * count.max(1)).enumerate().try_for_each(|(block, columns)| {
            for i in 0..count {
                let entries = &cage_coords.row(i)[16 * block..];
                columns[i..].iter_mut().step_by(count).zip(entries).for_each(|(x, phi)| *x = *phi as f32);
            }
            blocks.step(1)
        })?;
        Ok(Self { skin: to_f32(skin), cage: cage.to_vec(), columns })
    }

    /// M₀, `#M by 3`.
    pub fn at_bind(&self) -> &[[f32; 3]] {
        &self.skin
    }

    /// Writes M for `cage` (C, `#C by 3`), of whose movement every vertex takes part by `mask` (`#M`;
    /// none: wholly); `offsets` (`#M by 3`, or none) are added.
    pub fn write(
        &self,
        cage: &[Point],
        mask: Option<&[f32]>,
        offsets: Option<&[[f32; 3]]>,
        rest: &mut [[f32; 3]],
    ) {
        let moved: Vec<(usize, [f32; 3])> = (0..cage.len())
            .filter(|&k| cage[k] != self.cage[k])
            .map(|k| (k, (cage[k] - self.cage[k]).map(|x| x as f32).into()))
            .collect();
        let panel = |(index, out): (usize, &mut [[f32; 3]])| {
            self.write_panel(index * PANEL, &moved, mask, offsets, out);
        };
        if rest.len() < PARALLEL_FROM {
            rest.chunks_mut(PANEL).enumerate().for_each(panel);
        } else {
            rest.par_chunks_mut(PANEL).enumerate().for_each(panel);
        }
    }

    fn write_panel(
        &self,
        first: usize,
        moved: &[(usize, [f32; 3])],
        mask: Option<&[f32]>,
        offsets: Option<&[[f32; 3]]>,
        out: &mut [[f32; 3]],
    ) {
        let (mut x, mut y, mut z) = ([0.0f32; PANEL], [0.0f32; PANEL], [0.0f32; PANEL]);
        for (k, [dx, dy, dz]) in moved {
            let column = &self.columns[k * self.skin.len() + first..][..out.len()];
            for (i, phi) in column.iter().enumerate() {
                x[i] += phi * dx;
                y[i] += phi * dy;
                z[i] += phi * dz;
            }
        }
        if let Some(mask) = mask {
            for (i, part) in mask[first..][..out.len()].iter().enumerate() {
                x[i] *= part;
                y[i] *= part;
                z[i] *= part;
            }
        }
        for (i, out) in out.iter_mut().enumerate() {
            let [a, b, c] = self.skin[first + i];
            *out = [a + x[i], b + y[i], c + z[i]];
        }
        if let Some(offsets) = offsets {
            let pairs = out.iter_mut().zip(&offsets[first..]);
            pairs.for_each(|(out, offset)| (0..3).for_each(|d| out[d] += offset[d]));
        }
    }
}
