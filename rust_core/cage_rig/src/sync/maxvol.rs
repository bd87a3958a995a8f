//! MaxVol: the rows of a tall matrix that span the largest volume.
//!
//! Based on [TTB12] Thiery, Tierny, Boubekeur, *CageR*, and the maxvol algorithm of Goreinov et al.
//! The anchors of [CTL*20] Eq. (8): c skin vertices whose rows Φ̃ determine the cage best, in the
//! sense that every other row is a combination of theirs with coefficients of about 1 at most
//! (max |Φ Φ̃⁻¹| ≤ `max_ratio`). Row-pivoted elimination on the most touched vertices of each
//! column, then swaps on the whole matrix. Cost: `#M · #C²` plus `#M · #C` a swap.

use crate::linalg::{long_product, Lu};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use rayon::prelude::*;

/// The rows tried first: this many with the largest entries of each column.
const CANDIDATES_PER_COLUMN: usize = 40;
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
    Ok(largest(&ratios(coords, &column_scale(coords), &all, rows, part)?).2)
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

/// B = Φ Φ̃⁻¹ over the independent columns, without a copy of Φ: Φ D (Φ̃ D)⁻¹ with D the scale.
fn ratios(
    coords: &Rows,
    scale: &[f64],
    independent: &[usize],
    rows: &[usize],
    part: &Part,
) -> Result<Rows, Cancelled> {
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
    long_product(coords, &right, part)
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

fn most_touched(coords: &Rows, part: &Part) -> Result<Vec<usize>, Cancelled> {
    let count = CANDIDATES_PER_COLUMN.min(coords.len());
    let columns = part.count(coords.columns());
    let chosen = (0..coords.columns())
        .into_par_iter()
        .map(|column| {
            let mut rows: Vec<usize> = (0..coords.len()).collect();
            if count < rows.len() {
                let entry = |i: usize| coords.row(i)[column].abs();
                rows.select_nth_unstable_by(count, |&i, &k| entry(k).total_cmp(&entry(i)).then(i.cmp(&k)));
            }
            rows.truncate(count);
            columns.step(1)?;
            Ok(rows)
        })
        .collect::<Result<Vec<_>, Cancelled>>()?;
    let mut chosen = chosen.concat();
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
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

/// Swaps a chosen row for the row that depends on it most, until no ratio is above the limit.
/// Each swap updates B = Φ Φ̃⁻¹ by rank one; at the end B is made afresh, so that the ratio
/// returned is not a sum of rounding.
fn improve(
    coords: &Rows,
    scale: &[f64],
    independent: &[usize],
    rows: &mut [usize],
    options: &MaxVolOptions,
    part: &Part,
) -> Result<(f64, usize), Cancelled> {
    let [first, swapping] = part.split([1.0, 4.0]);
    let mut swaps = 0;
    loop {
        let before = swaps;
        let mut ratios = ratios(coords, scale, independent, rows, &first)?;
        let fresh = largest(&ratios).2;
        loop {
            let (row, column, ratio) = largest(&ratios);
            if ratio <= options.max_ratio || swaps >= options.max_swaps || !ratio.is_finite() {
                break;
            }
            swap(&mut ratios, row, column);
            rows[column] = row;
            swaps += 1;
            swapping.reach(1.0 - 1.0 / (1.0 + swaps as f64 / USUAL_SWAPS))?;
        }
        if swaps == before || swaps >= options.max_swaps {
            return Ok((fresh, swaps));
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
