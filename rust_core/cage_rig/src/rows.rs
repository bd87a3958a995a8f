//! [`Rows`]: a dense matrix stored row by row, the shape in which coordinates are made and read.

use crate::points::{is_usable, Point};
use rayon::prelude::*;

/// A dense `f64` matrix in row-major order. One row per moved point, one column per mover.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    columns: usize,
    data: Vec<f64>,
}

impl Rows {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { columns, data: vec![0.0; rows * columns] }
    }

    /// Takes `data`, `rows · columns` numbers, row by row. `None` when the count does not fit.
    pub fn from_vec(rows: usize, columns: usize, data: Vec<f64>) -> Option<Self> {
        (data.len() == rows * columns).then_some(Self { columns, data })
    }

    /// The same numbers in rows of another width (a divisor of their count).
    pub(crate) fn reshaped(self, columns: usize) -> Self {
        Self { columns, data: self.data }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.data.len().checked_div(self.columns).unwrap_or(0)
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Row `index`.
    pub fn row(&self, index: usize) -> &[f64] {
        &self.data[index * self.columns..][..self.columns]
    }

    /// Row `index`, to write.
    pub fn row_mut(&mut self, index: usize) -> &mut [f64] {
        &mut self.data[index * self.columns..][..self.columns]
    }

    /// All numbers, row by row.
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }

    /// All numbers, row by row, to write.
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// The rows named by `indices`, in that order.
    pub fn select(&self, indices: &[usize]) -> Self {
        let data = indices.iter().flat_map(|&i| self.row(i).iter().copied()).collect();
        Self { columns: self.columns, data }
    }

    /// Columns for rows.
    pub(crate) fn transposed(&self) -> Self {
        let mut out = Self::zeros(self.columns, self.len());
        for i in 0..self.len() {
            self.row(i).iter().enumerate().for_each(|(k, x)| out.row_mut(k)[i] = *x);
        }
        out
    }

    /// Row `index` times `points` (`#columns by 3`).
    pub fn combine(&self, index: usize, points: &[Point]) -> Point {
        self.row(index).iter().zip(points).map(|(w, p)| *w * p).sum()
    }

    /// The product with `points` (`#columns by 3`): one combined point per row.
    pub fn times(&self, points: &[Point]) -> Vec<Point> {
        (0..self.len()).into_par_iter().with_min_len(256).map(|i| self.combine(i, points)).collect()
    }

    /// The same, written into `out`; in one thread.
    pub(crate) fn times_into(&self, points: &[Point], out: &mut Vec<Point>) {
        out.clear();
        out.extend((0..self.len()).map(|i| self.combine(i, points)));
    }

    /// The first row with a number that is not usable.
    pub(crate) fn first_unusable(&self) -> Option<usize> {
        (0..self.len()).find(|&i| !self.row(i).iter().all(is_usable))
    }
}
