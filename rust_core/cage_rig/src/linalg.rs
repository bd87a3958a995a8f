//! Dense linear algebra, the only file that names faer: LU, SVD, products.

use crate::points::Point;
use crate::progress::{unwatched, Cancelled, Part};
use crate::rows::Rows;
use faer::linalg::matmul::matmul;
use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::linalg::triangular_solve::{solve_unit_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::reborrow::ReborrowMut;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

fn view(rows: &Rows) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(rows.as_slice(), rows.len(), rows.columns())
}

fn to_rows(matrix: MatRef<'_, f64>) -> Rows {
    let mut rows = Rows::zeros(matrix.nrows(), matrix.ncols());
    for i in 0..matrix.nrows() {
        rows.row_mut(i).iter_mut().enumerate().for_each(|(j, x)| *x = matrix[(i, j)]);
    }
    rows
}

/// Rows of a product that one thread makes at a time.
const PRODUCT_ROWS: usize = 1024;

/// A · B.
pub(crate) fn product(a: &Rows, b: &Rows) -> Rows {
    unwatched(|part| long_product(a, b, part))
}

/// A · B, where A has many rows.
pub(crate) fn long_product(a: &Rows, b: &Rows, part: &Part) -> Result<Rows, Cancelled> {
    let mut out = Rows::zeros(a.len(), b.columns());
    if out.is_empty() || a.columns() == 0 {
        return Ok(out);
    }
    let (inner, width) = (a.columns(), b.columns());
    let count = part.count(a.len());
    let blocks = out.as_mut_slice().par_chunks_mut(PRODUCT_ROWS * width);
    blocks.zip(a.as_slice().par_chunks(PRODUCT_ROWS * inner)).try_for_each(|(out, a)| {
        let rows = out.len() / width;
        let left = MatRef::from_row_major_slice(a, rows, inner);
        let target = MatMut::from_row_major_slice_mut(out, rows, width);
        matmul(target, Accum::Replace, left, view(b), 1.0, Par::Seq);
        count.step(rows)
    })?;
    Ok(out)
}

/// What `visit` finds in each block of rows of A · B, from their first one on; the product is not kept.
pub(crate) fn each_product<T: Send>(
    a: &Rows,
    b: &Rows,
    part: &Part,
    visit: impl Fn(usize, &[f64]) -> T + Sync,
) -> Result<Vec<T>, Cancelled> {
    let (inner, width) = (a.columns(), b.columns());
    let count = part.count(a.len());
    let blocks = a.as_slice().par_chunks(PRODUCT_ROWS * inner.max(1)).enumerate();
    let found = blocks.map_init(
        || vec![0.0; PRODUCT_ROWS * width],
        |out, (block, a)| {
            let rows = a.len() / inner;
            let left = MatRef::from_row_major_slice(a, rows, inner);
            let target = MatMut::from_row_major_slice_mut(&mut out[..rows * width], rows, width);
            matmul(target, Accum::Replace, left, view(b), 1.0, Par::Seq);
            count.step(rows)?;
            Ok(visit(block * PRODUCT_ROWS, &out[..rows * width]))
        },
    );
    found.collect()
}

/// The factors of a square matrix, made once and solved with often.
#[derive(Debug, Clone)]
pub(crate) struct Lu {
    factors: PartialPivLu<f64>,
}

impl Lu {
    /// Factors `square`. Costs ⅔ n³.
    pub(crate) fn new(square: &Rows) -> Self {
        Self { factors: view(square).partial_piv_lu() }
    }

    /// Smallest over largest pivot: 0 (or NaN) for a singular matrix, tiny for a nearly singular one.
    pub(crate) fn pivot_ratio(&self) -> f64 {
        let u = self.factors.U();
        let pivots = (0..u.nrows()).map(|i| u[(i, i)].abs());
        let (low, high) = pivots.fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), p| (l.min(p), h.max(p)));
        if high > 0.0 && high.is_finite() {
            low / high
        } else {
            0.0
        }
    }

    /// Solves for three right sides at once, one per coordinate, and writes the solution into `out`;
    /// `numbers` is what it works with.
    pub(crate) fn solve_points_into(&self, right: &[Point], numbers: &mut Vec<f64>, out: &mut Vec<Point>) {
        let (count, (order, _)) = (right.len(), self.factors.P().arrays());
        numbers.clear();
        (0..3).for_each(|d| numbers.extend(order.iter().map(|&i| right[i][d])));
        let mut x = MatMut::from_column_major_slice_mut(numbers, count, 3);
        solve_unit_lower_triangular_in_place(self.factors.L(), x.rb_mut(), Par::Seq);
        solve_upper_triangular_in_place(self.factors.U(), x.rb_mut(), Par::Seq);
        out.clear();
        out.extend((0..count).map(|i| Point::new(x[(i, 0)], x[(i, 1)], x[(i, 2)])));
    }

    /// Solves for one right side of 3n numbers, x y z of each point in turn.
    pub(crate) fn solve_interleaved(&self, right: &[Point]) -> Vec<Point> {
        let right = Mat::from_fn(right.len() * 3, 1, |i, _| right[i / 3][i % 3]);
        let x = self.factors.solve(&right);
        (0..x.nrows() / 3).map(|i| Point::new(x[(3 * i, 0)], x[(3 * i + 1, 0)], x[(3 * i + 2, 0)])).collect()
    }

    /// Solves for one right side.
    pub(crate) fn solve_one(&self, right: &[f64]) -> Vec<f64> {
        let x = self.factors.solve(&Mat::from_fn(right.len(), 1, |i, _| right[i]));
        (0..x.nrows()).map(|i| x[(i, 0)]).collect()
    }

    /// A⁻¹.
    pub(crate) fn inverse(&self) -> Rows {
        let size = self.factors.U().nrows();
        to_rows(self.factors.solve(&Mat::<f64>::identity(size, size)).as_ref())
    }
}

/// A = U Σ Vᵀ, thin: singular values fall.
pub(crate) struct Svd {
    pub(crate) u: Rows,
    pub(crate) singular_values: Vec<f64>,
    pub(crate) v: Rows,
}

/// The thin singular value decomposition; `None` if the iteration fails (input not finite).
pub(crate) fn svd(matrix: &Rows) -> Option<Svd> {
    let found = view(matrix).thin_svd().ok()?;
    let values = found.S().column_vector();
    let singular_values = (0..values.nrows()).map(|i| values[i]).collect();
    Some(Svd { u: to_rows(found.U()), singular_values, v: to_rows(found.V()) })
}
