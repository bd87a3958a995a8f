//! Mean value coordinates of points with respect to a triangle mesh.
//!
//! Based on [JSW05] Ju, Schaefer, Warren, *Mean value coordinates for closed triangular meshes*,
//! in vector form: the mean vector m of a spherical triangle is a sum over its sides, and the
//! weights are the components of m along the directions to the corners. One angle per edge, so
//! `#points · (#edges + #faces)`. Defined inside, on and outside a closed mesh.
//!
//! Points are worked on one a lane (`lanes.rs`), pieces of the mesh one after the other (`patch.rs`).
//!
//! We differ from the paper where it is unstable: on the surface the distance decides (not an
//! angle), a face seen edge-on has formulas without cancellation (`degenerate.rs`), and what
//! rounding leaves of linear precision is corrected by the smallest change (`Correction`).

use super::lanes::Weigh;
use super::patch::{patches, Patch, Sight};
use crate::cage::Cage;
use crate::points::{bounding_diagonal, Matrix3, Point};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use crate::simd::Path;
use rayon::prelude::*;

/// Points nearer than this part of the size lie *on* a vertex, an edge or a face.
const TOUCH: f64 = 1e-12;
/// Points that one thread takes at a time.
const CHUNK: usize = 64;

/// Φ, `#points by #C`, of `points` (`#points by 3`): rows sum to 1 and reproduce their point.
pub fn coordinates(cage: &Cage, points: &[Point], part: &Part) -> Result<Rows, Cancelled> {
    let surface = Surface::new(cage.vertices(), cage.triangles());
    let correction = Correction::new(cage.vertices());
    let width = cage.vertices().len();
    let mut rows = Rows::zeros(points.len(), width);
    let count = part.count(points.len());
    let chunks = rows.as_mut_slice().par_chunks_mut(CHUNK * width).zip(points.par_chunks(CHUNK));
    chunks.try_for_each(|(rows, points)| {
        surface.weigh(points, Some(&correction), rows, part)?;
        count.step(points.len())
    })?;
    Ok(rows)
}

/// A triangle mesh, open or closed, prepared for weights of many points.
pub struct Surface<'a> {
    pub(super) vertices: &'a [Point],
    pub(super) patches: Vec<Patch>,
    pub(super) size: f64,
    pub(super) touch: f64,
}

impl<'a> Surface<'a> {
    /// Prepares `vertices` (`#V by 3`) and `triangles`; triangles without area count for nothing.
    pub fn new(vertices: &'a [Point], triangles: &[[u32; 3]]) -> Self {
        let size = bounding_diagonal(vertices);
        let patches = patches(vertices, triangles, TOUCH * TOUCH * size * size);
        Self { vertices, patches, size, touch: TOUCH * size }
    }

    /// Writes the weights of `points` into `rows` (`#points by #V`): sums are 1, or all are 0 where the
    /// mesh has no weight at all. Looks for a cancel at every piece of the mesh.
    pub fn weights(&self, points: &[Point], rows: &mut [f64], part: &Part) -> Result<(), Cancelled> {
        self.weigh(points, None, rows, part)
    }

    fn weigh(
        &self,
        points: &[Point],
        correction: Option<&Correction>,
        rows: &mut [f64],
        part: &Part,
    ) -> Result<(), Cancelled> {
        let mut done = Ok(());
        Path::default().run(Weigh { surface: self, points, correction, rows, part, done: &mut done });
        done
    }

    /// What every face adds to the row of `point`, each seen closely; and whether one is touched.
    pub(super) fn seen_closely(&self, point: &Point) -> (Vec<f64>, bool) {
        let (mut row, mut touched) = (vec![0.0; self.vertices.len()], false);
        for patch in &self.patches {
            for face in &patch.faces {
                match patch.sight(face, self.vertices, point, self.touch) {
                    Sight::Weights(weights) => {
                        let corners = face.corners.map(|v| patch.vertices[v as usize] as usize);
                        corners.iter().zip(weights).for_each(|(v, weight)| row[*v] += weight);
                    }
                    Sight::Nothing => {}
                    Sight::Touched => touched = true,
                }
            }
        }
        (row, touched)
    }

    /// The row of a point on a vertex, or else on an edge, or else on a face.
    pub(super) fn place(&self, point: &Point, row: &mut [f64]) {
        row.fill(0.0);
        for level in 0..3 {
            let place = |patch: &Patch| patch.place(level, self.vertices, point, self.touch, row);
            if self.patches.iter().any(place) {
                return;
            }
        }
    }
}

/// The smallest change of a row that makes it reproduce its point.
pub(super) struct Correction {
    pub(super) middle: Point,
    pub(super) spread_inverse: Option<Matrix3>,
    tolerance: f64,
}

impl Correction {
    fn new(vertices: &[Point]) -> Self {
        let middle = vertices.iter().sum::<Point>() / vertices.len() as f64;
        let spread: Matrix3 = vertices.iter().map(|c| (c - middle) * (c - middle).transpose()).sum();
        Self { middle, spread_inverse: spread.try_inverse(), tolerance: 1e-14 * bounding_diagonal(vertices) }
    }

    pub(super) fn apply(&self, vertices: &[Point], point: &Point, row: &mut [f64]) {
        let miss: Point = row.iter().zip(vertices).map(|(w, c)| *w * (c - point)).sum();
        if let (true, Some(inverse)) = (miss.norm() > self.tolerance, self.spread_inverse) {
            let slope = inverse * miss;
            row.iter_mut().zip(vertices).for_each(|(w, c)| *w -= slope.dot(&(c - self.middle)));
        }
    }
}
