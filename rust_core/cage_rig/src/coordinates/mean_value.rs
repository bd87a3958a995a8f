//! Mean value coordinates of points with respect to a triangle mesh.
//!
//! Based on [JSW05] Ju, Schaefer, Warren, *Mean value coordinates for closed triangular meshes*,
//! in vector form: the mean vector m of a spherical triangle is a sum over its sides, and the
//! weights are the components of m along the directions to the corners. One angle per edge, so
//! `#points · (#edges + #faces)`. Defined inside, on and outside a closed mesh.
//!
//! We differ from the paper where it is unstable: on the surface the distance decides (not an
//! angle), a face seen edge-on has formulas without cancellation (`degenerate.rs`), and what
//! rounding leaves of linear precision is corrected by the smallest change (`Correction`).

use super::degenerate::Seen;
use crate::cage::Cage;
use crate::points::{bounding_diagonal, Matrix3, Point};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
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
    chunks.try_for_each_init(Scratch::default, |scratch, (rows, points)| {
        for (row, point) in rows.chunks_exact_mut(width).zip(points) {
            surface.weights(point, scratch, row);
            correction.apply(cage.vertices(), point, row);
        }
        count.step(points.len())
    })?;
    Ok(rows)
}

/// A triangle mesh, open or closed, prepared for weights of many points.
pub struct Surface<'a> {
    vertices: &'a [Point],
    edges: Vec<[u32; 2]>,
    faces: Vec<Face>,
    touch: f64,
}

/// A triangle with area. Side k runs between the two other corners, along edge `edges[k]`
/// (`signs[k]` is −1 when against it).
struct Face {
    corners: [usize; 3],
    edges: [usize; 3],
    signs: [f64; 3],
    double_area: f64,
}

/// What is known of an edge from one point: u_a × u_b and its length, half the angle along it, the
/// angle.
#[derive(Clone, Copy)]
struct Side {
    cross: Point,
    sine: f64,
    half: Point,
    angle: f64,
}

/// Room for one point's work, reused from point to point.
#[derive(Default)]
pub struct Scratch {
    directions: Vec<Point>,
    distances: Vec<f64>,
    sides: Vec<Side>,
}

impl<'a> Surface<'a> {
    /// Prepares `vertices` (`#V by 3`) and `triangles`; triangles without area count for nothing.
    pub fn new(vertices: &'a [Point], triangles: &[[u32; 3]]) -> Self {
        let size = bounding_diagonal(vertices);
        // Edges by their lower vertex, of which each has a few.
        let mut known: Vec<Vec<(u32, usize)>> = vec![Vec::new(); vertices.len()];
        let mut edges = Vec::with_capacity(triangles.len() * 3 / 2);
        let mut faces = Vec::with_capacity(triangles.len());
        for triangle in triangles {
            let corners = triangle.map(|v| v as usize);
            let [a, b, c] = corners.map(|v| vertices[v]);
            let double_area = (b - a).cross(&(c - a)).norm();
            if double_area <= TOUCH * TOUCH * size * size {
                continue;
            }
            let mut face = Face { corners, edges: [0; 3], signs: [1.0; 3], double_area };
            for k in 0..3 {
                let (from, to) = (triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
                let (low, high) = (from.min(to), from.max(to));
                let around = &mut known[low as usize];
                let found = around.iter().find(|(end, _)| *end == high);
                face.edges[k] = found.map_or(edges.len(), |(_, edge)| *edge);
                if face.edges[k] == edges.len() {
                    around.push((high, edges.len()));
                    edges.push([low, high]);
                }
                face.signs[k] = if from < to { 1.0 } else { -1.0 };
            }
            faces.push(face);
        }
        Self { vertices, edges, faces, touch: TOUCH * size }
    }

    /// Writes the weights of `point` into `row` (one per vertex, sum 1; all 0 when the mesh has no
    /// weight at all).
    pub fn weights(&self, point: &Point, scratch: &mut Scratch, row: &mut [f64]) {
        row.fill(0.0);
        if self.at_vertex(point, scratch, row) || self.at_edge(scratch, row) {
            return;
        }
        for face in &self.faces {
            if self.add_face(face, scratch, row) {
                return;
            }
        }
        let sum: f64 = row.iter().sum();
        let scale = if sum == 0.0 { 0.0 } else { 1.0 / sum };
        row.iter_mut().for_each(|w| *w *= scale);
    }

    /// Finds distances and directions. True when the point is a vertex: then the row is done.
    fn at_vertex(&self, point: &Point, scratch: &mut Scratch, row: &mut [f64]) -> bool {
        scratch.directions.clear();
        scratch.distances.clear();
        for (k, vertex) in self.vertices.iter().enumerate() {
            let toward = vertex - point;
            let distance = toward.norm();
            if distance <= self.touch {
                row[k] = 1.0;
                return true;
            }
            scratch.distances.push(distance);
            scratch.directions.push(toward / distance);
        }
        false
    }

    /// Finds what edges look like. True when the point is on an edge: then the row is done.
    fn at_edge(&self, scratch: &mut Scratch, row: &mut [f64]) -> bool {
        scratch.sides.clear();
        for &[a, b] in &self.edges {
            let (a, b) = (a as usize, b as usize);
            let (from, to) = (scratch.directions[a], scratch.directions[b]);
            // Not u_a × u_b: the difference is exact where the two are close.
            let cosine = from.dot(&to);
            let cross = if cosine > 0.5 { from.cross(&(to - from)) } else { from.cross(&to) };
            let sine = cross.norm();
            if cosine < 0.0 {
                let (near, far) = (scratch.distances[a], scratch.distances[b]);
                if sine * near * far <= self.touch * (near + far) {
                    row[a] = far / (near + far);
                    row[b] = near / (near + far);
                    return true;
                }
            }
            let angle = sine.atan2(cosine);
            let ratio = if sine > 0.0 { angle / sine } else { 1.0 };
            scratch.sides.push(Side { cross, sine, half: cross * (0.5 * ratio), angle });
        }
        false
    }

    /// Adds one face's weights. True when the point is on it: then the row is done.
    fn add_face(&self, face: &Face, scratch: &Scratch, row: &mut [f64]) -> bool {
        let sides = face.edges.map(|e| scratch.sides[e]);
        let distances = face.corners.map(|v| scratch.distances[v]);
        let crosses: [Point; 3] = std::array::from_fn(|k| sides[k].cross * face.signs[k]);
        let sines = sides.map(|s| s.sine);
        // The determinant is most exact from the shortest side.
        let short = (0..3).min_by(|&i, &k| sines[i].total_cmp(&sines[k])).unwrap_or(0);
        let determinant = scratch.directions[face.corners[short]].dot(&crosses[short]);
        let height = determinant.abs() * distances[0] * distances[1] * distances[2] / face.double_area;
        // Cosines of the angles between the sides at each corner, up to a positive factor.
        let turns: [f64; 3] = std::array::from_fn(|k| -crosses[(k + 1) % 3].dot(&crosses[(k + 2) % 3]));
        if height <= self.touch {
            if turns.iter().any(|&turn| turn > 0.0) {
                return false; // in the face's plane, outside it: no weight
            }
            // On the face: barycentric coordinates, from the areas opposite the corners.
            row.fill(0.0);
            let areas: [f64; 3] =
                std::array::from_fn(|k| crosses[k].norm() * distances[(k + 1) % 3] * distances[(k + 2) % 3]);
            (0..3).for_each(|k| row[face.corners[k]] = areas[k] / areas.iter().sum::<f64>());
            return true;
        }
        let seen = Seen {
            directions: face.corners.map(|v| scratch.directions[v]),
            angles: sides.map(|s| s.angle),
            sines,
            turns,
            determinant,
        };
        let components = seen.degenerate_components(short).unwrap_or_else(|| {
            let mean: Point = (0..3).map(|k| sides[k].half * face.signs[k]).sum();
            crosses.map(|cross| mean.dot(&cross) / determinant)
        });
        (0..3).for_each(|k| row[face.corners[k]] += components[k] / distances[k]);
        false
    }
}

/// The smallest change of a row that makes it reproduce its point.
struct Correction {
    middle: Point,
    spread_inverse: Option<Matrix3>,
    tolerance: f64,
}

impl Correction {
    fn new(vertices: &[Point]) -> Self {
        let middle = vertices.iter().sum::<Point>() / vertices.len() as f64;
        let spread: Matrix3 = vertices.iter().map(|c| (c - middle) * (c - middle).transpose()).sum();
        Self { middle, spread_inverse: spread.try_inverse(), tolerance: 1e-14 * bounding_diagonal(vertices) }
    }

    fn apply(&self, vertices: &[Point], point: &Point, row: &mut [f64]) {
        let miss: Point = row.iter().zip(vertices).map(|(w, c)| *w * (c - point)).sum();
        if let (true, Some(inverse)) = (miss.norm() > self.tolerance, self.spread_inverse) {
            let slope = inverse * miss;
            row.iter_mut().zip(vertices).for_each(|(w, c)| *w -= slope.dot(&(c - self.middle)));
        }
    }
}
