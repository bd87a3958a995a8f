//! MaxVol: the rows of a tall matrix that span the largest volume.
//!
//! Based on [TTB12] Thiery, Tierny, Boubekeur, *CageR*, and the maxvol algorithm of Goreinov et al.
//! The anchors of [CTL*20] Eq. (8): c skin vertices whose rows Φ̃ determine the cage best, in the
//! sense that every other row is a combination of theirs with coefficients of about 1 at most
//! (max |Φ Φ̃⁻¹| ≤ `max_ratio`). Row-pivoted elimination on the most touched vertices of each
//! column, then swaps among the rows that break the limit. Cost: `#M · #C²` a look at all of them, of
//! which there are few, and no copy of Φ.

use crate::linalg::{each_product, long_product, Lu};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use rayon::prelude::*;

/// The rows tried first: this many with the largest entries of each column.
const CANDIDATES_PER_COLUMN: usize = 40;
/// Rows that one thread looks at at a time.
const SEEN_AT_ONCE: usize = 8192;
/// Rows that break the limit are tried together, at most this many a column.
const TRIED_PER_COLUMN: usize = 16;
/// A pivot below this part of its column depends on the columns before it.
const DEPENDENT: f64 = 1e-13;

/// How many swaps are half of what there may be, for the progress: nobody knows before.
const USUAL_SWAPS: f64 = 20.0;

/// When to stop swapping.
#[derive(Debug, Clone, Copy)]
pub struct MaxVolOptions {
    /// max |Φ Φ̃⁻¹| to reach; 1.05 as in [TTB12].
    pub max_ratio: f64,
    /// Most swaps; some tens happen.
    pub max_swaps: usize,
}

impl Default for MaxVolOptions {
    fn default() -> Self {
        Self { max_ratio: 1.05, max_swaps: 10_000 }
    }
}

/// The rows chosen.
#[derive(Debug, Clone)]
pub struct MaxVol {
    /// min(`#M`, `#C`) distinct row numbers.
    pub rows: Vec<usize>,
    /// max |Φ Φ̃⁻¹| reached, over independent columns.
    pub ratio: f64,
    /// Swaps made.
    pub swaps: usize,
}

/// Chooses among the rows of `coords` (Φ, `#M by #C`).
pub fn maxvol(coords: &Rows, options: &MaxVolOptions, part: &Part) -> Result<MaxVol, Cancelled> {
    let wanted = coords.len().min(coords.columns());
    let scale = column_scale(coords);
    let [starting, improving] = part.split([1.0, 3.0]);
    let start = start(coords, &scale, wanted, &starting)?;
    let mut rows: Vec<usize> = start.iter().map(|pivot| pivot.0).collect();
    let independent: Vec<usize> = start.iter().map(|pivot| pivot.1).collect();
    let (mut ratio, mut swaps) = (1.0, 0);
    if !rows.is_empty() && rows.len() < coords.len() {
        (ratio, swaps) = improve(coords, &scale, &independent, &mut rows, options, &improving)?;
    }
    fill_up(coords, &mut rows, wanted);
    Ok(MaxVol { rows, ratio, swaps })
}

/// max |Φ Φ̃⁻¹| of a given choice of as many rows as columns.
pub fn ratio_of(coords: &Rows, rows: &[usize], part: &Part) -> Result<f64, Cancelled> {
    let all: Vec<usize> = (0..coords.columns()).collect();
    let right = right_factor(coords, &column_scale(coords), &all, rows);
    Ok(beyond(coords, &right, f64::INFINITY, part)?.0)
}

/// One over the largest entry of each column (0 for a column of zeros). Scaling columns changes
/// no ratio and keeps rounding away from the faint ones.
fn column_scale(coords: &Rows) -> Vec<f64> {
    let mut largest = vec![0.0f64; coords.columns()];
    for i in 0..coords.len() {
        largest.iter_mut().zip(coords.row(i)).for_each(|(m, x)| *m = m.max(x.abs()));
    }
    largest.iter().map(|m| if *m > 0.0 { 1.0 / m } else { 0.0 }).collect()
}

fn scaled(coords: &Rows, scale: &[f64], rows: &[usize]) -> Rows {
    let mut chosen = coords.select(rows);
    for i in 0..chosen.len() {
        chosen.row_mut(i).iter_mut().zip(scale).for_each(|(x, s)| *x *= s);
    }
    chosen
}

/// D (Φ̃ D)⁻¹ over the independent columns, with D the scale: Φ times it is B = Φ Φ̃⁻¹.
fn right_factor(coords: &Rows, scale: &[f64], independent: &[usize], rows: &[usize]) -> Rows {
    let anchors = scaled(coords, scale, rows);
    let mut square = Rows::zeros(rows.len(), independent.len());
    for i in 0..rows.len() {
        let row = anchors.row(i);
        square.row_mut(i).iter_mut().zip(independent).for_each(|(x, &k)| *x = row[k]);
    }
    let inverse = Lu::new(&square).inverse();
    let mut right = Rows::zeros(coords.columns(), rows.len());
    for (i, &k) in independent.iter().enumerate() {
        right.row_mut(k).iter_mut().zip(inverse.row(i)).for_each(|(x, y)| *x = scale[k] * y);
    }
    right
}

/// max |B|, and the rows of B beyond `limit` with theirs, the largest first. B is never kept.
fn beyond(
    coords: &Rows,
    right: &Rows,
    limit: f64,
    part: &Part,
) -> Result<(f64, Vec<(f64, usize)>), Cancelled> {
    let width = right.columns();
    let blocks = each_product(coords, right, part, |first, block| {
        let (mut most, mut rows) = (0.0f64, Vec::new());
        for (i, row) in block.chunks_exact(width).enumerate() {
            let ratio = row.iter().fold(0.0f64, |most, x| if x.abs() > most { x.abs() } else { most });
            most = most.max(ratio);
            if ratio > limit {
                rows.push((ratio, first + i));
            }
        }
        (most, rows)
    })?;
    let most = blocks.iter().fold(0.0, |most: f64, block| most.max(block.0));
    let mut rows: Vec<(f64, usize)> = blocks.into_iter().flat_map(|block| block.1).collect();
    rows.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    Ok((most, rows))
}

/// Pivots (row, column) of an elimination on the most touched rows, on all of them if those do
/// not reach the full rank.
fn start(coords: &Rows, scale: &[f64], wanted: usize, part: &Part) -> Result<Vec<(usize, usize)>, Cancelled> {
    let [choosing, eliminating] = part.split([2.0, 1.0]);
    let candidates = most_touched(coords, &choosing)?;
    let pivots = eliminate(scaled(coords, scale, &candidates), &eliminating)?;
    if pivots.len() < wanted && candidates.len() < coords.len() {
        let all: Vec<usize> = (0..coords.len()).collect();
        return eliminate(scaled(coords, scale, &all), &eliminating);
    }
    Ok(pivots.into_iter().map(|(row, column)| (candidates[row], column)).collect())
}

/// The rows with the largest entries of each column, each once.
fn most_touched(coords: &Rows, part: &Part) -> Result<Vec<usize>, Cancelled> {
    let (columns, count) = (coords.columns(), part.count(coords.len()));
    let blocks = coords.as_slice().par_chunks(SEEN_AT_ONCE * columns).enumerate();
    let best = blocks.map(|(block, entries)| {
        let mut best = vec![Best::default(); columns];
        for (i, row) in entries.chunks_exact(columns).enumerate() {
            for (best, entry) in best.iter_mut().zip(row).filter(|(best, entry)| entry.abs() > best.least) {
                best.push(entry.abs(), block * SEEN_AT_ONCE + i);
            }
        }
        count.step(entries.len() / columns)?;
        Ok(best)
    });
    let merge = |mut a: Vec<Best>, b: Vec<Best>| {
        a.iter_mut().zip(b).for_each(|(a, b)| b.found.iter().for_each(|&(entry, row)| a.push(entry, row)));
        Ok(a)
    };
    let mut best = best.try_reduce_with(merge).unwrap_or(Ok(Vec::new()))?;
    best.iter_mut().for_each(Best::shorten);
    let mut chosen: Vec<usize> =
        best.iter().flat_map(|best| best.found.iter().map(|(_, row)| *row)).collect();
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

/// The largest entries of a column and their rows, some more than are wanted; what is not above
/// `least` need not be tried.
#[derive(Clone)]
struct Best {
    least: f64,
    found: Vec<(f64, usize)>,
}

impl Default for Best {
    fn default() -> Self {
        Self { least: -1.0, found: Vec::new() }
    }
}

impl Best {
    fn push(&mut self, entry: f64, row: usize) {
        self.found.push((entry, row));
        if self.found.len() >= 4 * CANDIDATES_PER_COLUMN {
            self.shorten();
        }
    }

    fn shorten(&mut self) {
        if self.found.len() <= CANDIDATES_PER_COLUMN {
            return;
        }
        let larger = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        let (_, last, _) = self.found.select_nth_unstable_by(CANDIDATES_PER_COLUMN - 1, larger);
        self.least = last.0;
        self.found.truncate(CANDIDATES_PER_COLUMN);
    }
}

/// Gaussian elimination with row pivots, column by column, skipping dependent columns.
fn eliminate(mut work: Rows, part: &Part) -> Result<Vec<(usize, usize)>, Cancelled> {
    let mut free = vec![true; work.len()];
    let mut pivots = Vec::with_capacity(work.columns());
    let columns = part.count(work.columns());
    for column in 0..work.columns() {
        columns.step(1)?;
        let entry = |i: usize| work.row(i)[column].abs();
        let best = (0..work.len())
            .filter(|&i| free[i])
            .max_by(|&i, &k| entry(i).total_cmp(&entry(k)).then(k.cmp(&i)));
        let Some(best) = best.filter(|&i| entry(i) > DEPENDENT) else { continue };
        free[best] = false;
        pivots.push((best, column));
        let pivot = work.row(best).to_vec();
        for i in (0..work.len()).filter(|&i| free[i]) {
            let factor = work.row(i)[column] / pivot[column];
            if factor != 0.0 {
                work.row_mut(i)[column..]
                    .iter_mut()
                    .zip(&pivot[column..])
                    .for_each(|(x, p)| *x -= factor * p);
            }
        }
    }
    Ok(pivots)
}

/// Swaps chosen rows for rows that depend on them most, until no ratio is above the limit. B is
/// looked through in blocks; swaps are made among the rows that break the limit, each a change of their
/// part of B by rank one. Every look starts afresh, so that the ratio returned is no sum of rounding.
fn improve(
    coords: &Rows,
    scale: &[f64],
    independent: &[usize],
    rows: &mut [usize],
    options: &MaxVolOptions,
    part: &Part,
) -> Result<(f64, usize), Cancelled> {
    let [first, swapping] = part.split([4.0, 1.0]);
    let mut swaps = 0;
    loop {
        let right = right_factor(coords, scale, independent, rows);
        let (ratio, mut tried) = beyond(coords, &right, options.max_ratio, &first)?;
        tried.truncate(TRIED_PER_COLUMN * coords.columns());
        let tried: Vec<usize> = tried.into_iter().map(|(_, row)| row).collect();
        let mut ratios = long_product(&coords.select(&tried), &right, &first)?;
        let before = swaps;
        while !tried.is_empty() && swaps < options.max_swaps {
            let (row, column, ratio) = largest(&ratios);
            if ratio <= options.max_ratio || !ratio.is_finite() {
                break;
            }
            swap(&mut ratios, row, column);
            rows[column] = tried[row];
            swaps += 1;
            swapping.reach(1.0 - 1.0 / (1.0 + swaps as f64 / USUAL_SWAPS))?;
        }
        if swaps == before {
            return Ok((ratio, swaps));
        }
    }
}

/// The largest entry: row, column, absolute value.
fn largest(matrix: &Rows) -> (usize, usize, f64) {
    let in_row = |i: usize| {
        let row = matrix.row(i).iter().enumerate();
        row.fold((i, 0, -1.0), |best, (k, x)| if x.abs() > best.2 { (i, k, x.abs()) } else { best })
    };
    let better = |a: (usize, usize, f64), b: (usize, usize, f64)| {
        if b.2 > a.2 || (b.2 == a.2 && b.0 < a.0) {
            b
        } else {
            a
        }
    };
    (0..matrix.len()).into_par_iter().with_min_len(512).map(in_row).reduce(|| (usize::MAX, 0, -1.0), better)
}

fn swap(ratios: &mut Rows, row: usize, column: usize) {
    let mut change = ratios.row(row).to_vec();
    let pivot = change[column];
    change[column] -= 1.0;
    let width = ratios.columns();
    ratios.as_mut_slice().par_chunks_mut(width * 512).for_each(|chunk| {
        for line in chunk.chunks_mut(width) {
            let factor = line[column] / pivot;
            line.iter_mut().zip(&change).for_each(|(x, c)| *x -= factor * c);
        }
    });
}

/// Where columns depend on each other fewer rows are independent: the most touched of the others
/// fill up, so that there are always min(`#M`, `#C`) anchors.
fn fill_up(coords: &Rows, rows: &mut Vec<usize>, wanted: usize) {
    let missing = wanted - rows.len();
    if missing == 0 {
        return;
    }
    let mut chosen = vec![false; coords.len()];
    rows.iter().for_each(|&row| chosen[row] = true);
    let touch = |i: usize| coords.row(i).iter().map(|x| x * x).sum::<f64>();
    let mut others: Vec<usize> = (0..coords.len()).filter(|&i| !chosen[i]).collect();
    others.sort_by(|&i, &k| touch(k).total_cmp(&touch(i)).then(i.cmp(&k)));
    rows.extend(others.into_iter().take(missing));
}
