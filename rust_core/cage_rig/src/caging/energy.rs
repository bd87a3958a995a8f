//! What a growing cage wants: to keep its shape, its distance, good faces, and little volume.
//!
//! A Laplacian of the displacement from a rest shape, a logarithmic barrier in every gap (after
//! Li et al., *Incremental Potential Contact*, 2020), a penalty on slivers, springs that
//! hold sections at their nodes, and a pressure. The Newton step keeps the positive part of each term
//! and is solved by conjugate gradients with 3 by 3 blocks.

use super::contacts::{Contact, Points};
use super::tubes::Scaffold;
use crate::points::{Matrix3, Point};
use rayon::prelude::*;

/// Weights of the terms; lengths relative to the size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weights {
    /// Shape: against the Laplacian of the displacement.
    pub(crate) shape: f64,
    /// Shape: against the displacement itself.
    pub(crate) anchor: f64,
    /// Against sections that slide along their limbs.
    pub(crate) slide: f64,
    /// Pressure from outside.
    pub(crate) volume: f64,
    /// Against triangles flatter than [`FLAT`].
    pub(crate) quality: f64,
    /// Width at which a gap begins to push.
    pub(crate) reach: f64,
    /// Width that no gap may fall to.
    pub(crate) least: f64,
}

/// Stiffness of the barrier.
const BARRIER: f64 = 20.0;
/// Shape quality (1 for an equilateral triangle) below which a triangle is penalised; a needle or a
/// cap of 10 degrees has 0.2 to 0.3.
const FLAT: f64 = 0.34;

/// Gaps this narrow, relative to the reach, are pushed open faster than Newton's method would.
const TINY: f64 = 0.1;

/// The cage's connectivity and rest shape.
pub(crate) struct Shape<'a> {
    pub(crate) faces: &'a [[u32; 3]],
    /// Triangles that quads may also be split into.
    pub(crate) others: &'a [[u32; 3]],
    pub(crate) edges: &'a [(u32, u32)],
    pub(crate) rest: &'a [Point],
    /// For each vertex its mirror image, x to −x.
    pub(crate) mirror: Option<&'a [u32]>,
    /// Whether a vertex moves; empty: all do.
    pub(crate) moves: &'a [bool],
    /// Sections that stay where they are along their limbs.
    pub(crate) sections: &'a [Station],
}

/// A section's vertices, and where along its limb their middle is to be.
#[derive(Debug, Clone)]
pub(crate) struct Station {
    pub(crate) vertices: Vec<usize>,
    pub(crate) along: Point,
    pub(crate) place: f64,
}

impl Station {
    /// How far the middle is from its place.
    fn off(&self, x: &[Point]) -> f64 {
        let sum: f64 = self.vertices.iter().map(|v| self.along.dot(&x[*v])).sum();
        sum / self.vertices.len() as f64 - self.place
    }
}

impl Shape<'_> {
    /// All triangles, each with the pressure on it.
    fn triangles(&self, w: &Weights) -> impl Iterator<Item = (&[u32; 3], f64)> {
        let (pressure, others) = (w.volume, self.others.iter().map(|t| (t, 0.0)));
        self.faces.iter().map(move |t| (t, pressure)).chain(others)
    }

    /// The part of a field of vectors that is symmetric, and zero where nothing moves.
    fn project(&self, field: &mut [Point]) {
        symmetrise(field, self.mirror);
        for (x, _) in field.iter_mut().zip(self.moves).filter(|(_, moves)| !**moves) {
            *x = Point::zeros();
        }
    }
}

/// Value, first and, where it is not tiny, second derivative of the barrier at width `d` over the
/// least.
fn barrier(d: f64, reach: f64) -> (f64, f64, f64) {
    if d >= reach {
        return (0.0, 0.0, 0.0);
    }
    let (ln, q) = ((d / reach).ln(), d - reach);
    let slope = -2.0 * q * ln - q * q / d;
    // The true curvature would open a tiny gap by no more than its own width a step.
    let curvature = (-2.0 * ln - 4.0 * q / d + q * q / (d * d)).min(-slope / (TINY * reach));
    (-q * q * ln, slope, curvature.max(0.0))
}

/// Quality of a triangle and its gradient at each corner.
fn quality(x: [&Point; 3]) -> (f64, [Point; 3]) {
    let [a, b, c] = x;
    let normal = (b - a).cross(&(c - a));
    let area = 0.5 * normal.norm();
    let unit = normal / normal.norm().max(1e-300);
    let lengths = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
    let scale = 4.0 * 3.0_f64.sqrt();
    let gradient = [0, 1, 2].map(|k| {
        let (p, q, r) = (x[k], x[(k + 1) % 3], x[(k + 2) % 3]);
        let of_area = unit.cross(&(r - q)) * 0.5;
        let of_lengths = (p * 2.0 - q - r) * 2.0;
        (of_area / lengths - of_lengths * (area / (lengths * lengths))) * scale
    });
    (scale * area / lengths, gradient)
}

/// The energy at `points`; infinite where a gap is closed.
pub(crate) fn energy(shape: &Shape, points: &Points, contacts: &[Contact], w: &Weights) -> f64 {
    let x = points.cage;
    let mut sum = 0.0;
    for &(a, b) in shape.edges {
        let (a, b) = (a as usize, b as usize);
        sum += 0.5 * w.shape * (x[a] - shape.rest[a] - x[b] + shape.rest[b]).norm_squared();
    }
    for (p, rest) in x.iter().zip(shape.rest) {
        sum += 0.5 * w.anchor * (p - rest).norm_squared();
    }
    for section in shape.sections {
        sum += 0.5 * w.slide * section.off(x).powi(2);
    }
    for (t, pressure) in shape.triangles(w) {
        let [a, b, c] = t.map(|v| &x[v as usize]);
        sum += pressure * a.dot(&b.cross(c)) / 6.0;
        let (q, _) = quality([a, b, c]);
        if q < FLAT {
            sum += w.quality * (q.max(1e-12) / FLAT).ln().powi(2);
        }
    }
    let push = |contact: &Contact| {
        let d = points.width(contact) - w.least;
        if d <= 0.0 {
            f64::INFINITY
        } else {
            BARRIER * barrier(d, w.reach).0
        }
    };
    sum + contacts.par_iter().with_min_len(512).map(push).sum::<f64>()
}

/// The Newton step from `points`.
pub(crate) fn newton_step(shape: &Shape, points: &Points, contacts: &[Contact], w: &Weights) -> Vec<Point> {
    let mut system = System::new(points.cage.len());
    let x = points.cage;
    for &(a, b) in shape.edges {
        let (i, j) = (a as usize, b as usize);
        let u = (x[i] - shape.rest[i] - x[j] + shape.rest[j]) * w.shape;
        system.gradient[i] += u;
        system.gradient[j] -= u;
        let block = Matrix3::identity() * w.shape;
        system.add(i, i, &block);
        system.add(j, j, &block);
        system.add(i, j, &-block);
        system.add(j, i, &-block);
    }
    for (i, (p, rest)) in x.iter().zip(shape.rest).enumerate() {
        system.gradient[i] += (p - rest) * w.anchor;
        system.add(i, i, &(Matrix3::identity() * (w.anchor + 1e-9)));
    }
    for section in shape.sections.iter().filter(|_| w.slide > 0.0) {
        let part = 1.0 / section.vertices.len() as f64;
        let block = section.along * section.along.transpose() * (w.slide * part * part);
        let pull = section.along * (w.slide * section.off(x) * part);
        for &i in &section.vertices {
            system.gradient[i] += pull;
            for &j in &section.vertices {
                system.add(i, j, &block);
            }
        }
    }
    for (t, pressure) in shape.triangles(w) {
        let corners = t.map(|v| &x[v as usize]);
        for k in 0..3 {
            system.gradient[t[k] as usize] +=
                corners[(k + 1) % 3].cross(corners[(k + 2) % 3]) * (pressure / 6.0);
        }
        let (q, gradient) = quality(corners);
        if q < FLAT && q > 1e-12 {
            let slope = 2.0 * w.quality * (q / FLAT).ln() / q;
            for (i, g) in t.iter().zip(&gradient) {
                system.gradient[*i as usize] += g * slope;
                for (j, h) in t.iter().zip(&gradient) {
                    system.add(*i as usize, *j as usize, &(g * h.transpose() * (2.0 * w.quality / (q * q))));
                }
            }
        }
    }
    let active = contacts.par_iter().with_min_len(512).filter_map(|contact| {
        let (weights, normal, width) = points.gap(contact);
        let d = width - w.least;
        (d < w.reach && d > 0.0).then(|| (contact.at, weights, normal, barrier(d, w.reach)))
    });
    for (at, weights, normal, (_, slope, curvature)) in active.collect::<Vec<_>>() {
        let outer = normal * normal.transpose() * (BARRIER * curvature);
        for (i, u) in at.iter().map(|v| *v as usize).zip(weights).filter(|(i, u)| *i < x.len() && *u != 0.0) {
            system.gradient[i] += normal * (BARRIER * slope * u);
            for (j, v) in
                at.iter().map(|v| *v as usize).zip(weights).filter(|(j, v)| *j < x.len() && *v != 0.0)
            {
                system.add(i, j, &(outer * (u * v)));
            }
        }
    }
    let mut step = system.solve(shape);
    shape.project(&mut step);
    step
}

/// Where the sections that close nothing are along their limbs, with these corners. None of a cage whose
/// vertices are not those of its sections, one after the other.
pub(crate) fn stations(scaffold: &Scaffold, corners: &[Point]) -> Vec<Station> {
    let of_section = scaffold.owner.iter().filter(|node| **node == 0).count().max(1);
    if scaffold.owner.iter().enumerate().any(|(v, node)| *node != v / of_section) {
        return Vec::new();
    }
    let count = scaffold.owner.last().map_or(0, |last| last + 1);
    let mut vertices = vec![Vec::new(); count];
    for (v, node) in scaffold.owner.iter().enumerate() {
        vertices[*node].push(v);
    }
    for polygon in &scaffold.polygons {
        let node = scaffold.owner[polygon[0] as usize];
        if polygon.iter().all(|v| scaffold.owner[*v as usize] == node) {
            vertices[node].clear();
        }
    }
    let station = |vertices: Vec<usize>| {
        let n = vertices.len();
        let corner = |k: usize| corners[vertices[k % n]];
        let middle = (0..n).map(corner).sum::<Point>() / n as f64;
        let around = (0..n).map(|k| (corner(k) - middle).cross(&(corner(k + 1) - middle))).sum::<Point>();
        let along = around.try_normalize(1e-12)?;
        Some(Station { vertices, along, place: along.dot(&middle) })
    };
    vertices.into_iter().filter(|vertices| !vertices.is_empty()).filter_map(station).collect()
}

/// The symmetric part of a field of vectors.
pub(crate) fn symmetrise(field: &mut [Point], mirror: Option<&[u32]>) {
    let Some(mirror) = mirror else { return };
    let image = |p: &Point| Point::new(-p.x, p.y, p.z);
    let old = field.to_vec();
    for (i, m) in mirror.iter().enumerate() {
        field[i] = (old[i] + image(&old[*m as usize])) * 0.5;
    }
}

/// Moves those of `points` that `moves` names to where they are symmetric.
pub(crate) fn symmetrise_points(points: &mut [Point], mirror: Option<&[u32]>, moves: &[bool]) {
    let mut even = points.to_vec();
    symmetrise(&mut even, mirror);
    for ((p, even), _) in points.iter_mut().zip(even).zip(moves).filter(|(_, moves)| **moves) {
        *p = even;
    }
}

/// A sparse symmetric system of 3 by 3 blocks.
struct System {
    gradient: Vec<Point>,
    rows: Vec<Vec<(u32, Matrix3)>>,
}

impl System {
    fn new(n: usize) -> Self {
        Self { gradient: vec![Point::zeros(); n], rows: vec![Vec::new(); n] }
    }

    fn add(&mut self, i: usize, j: usize, block: &Matrix3) {
        match self.rows[i].iter_mut().find(|(k, _)| *k as usize == j) {
            Some((_, sum)) => *sum += block,
            None => self.rows[i].push((j as u32, *block)),
        }
    }

    fn times(&self, x: &[Point]) -> Vec<Point> {
        self.rows.iter().map(|row| row.iter().map(|(j, block)| block * x[*j as usize]).sum()).collect()
    }

    /// −H⁻¹ g within the fields that the shape allows.
    fn solve(&self, shape: &Shape) -> Vec<Point> {
        let n = self.gradient.len();
        let inverse: Vec<Matrix3> = (0..n)
            .map(|i| {
                let block = self.rows[i]
                    .iter()
                    .find(|(j, _)| *j as usize == i)
                    .map_or(Matrix3::identity(), |(_, b)| *b);
                block.try_inverse().unwrap_or_else(Matrix3::identity)
            })
            .collect();
        let apply = |r: &[Point]| {
            let mut z: Vec<Point> = r.iter().zip(&inverse).map(|(r, m)| m * r).collect();
            shape.project(&mut z);
            z
        };
        let dot = |a: &[Point], b: &[Point]| a.iter().zip(b).map(|(p, q)| p.dot(q)).sum::<f64>();
        let mut x = vec![Point::zeros(); n];
        let mut r: Vec<Point> = self.gradient.iter().map(|g| -g).collect();
        shape.project(&mut r);
        let mut z = apply(&r);
        let mut p = z.clone();
        let mut rho = dot(&r, &z);
        let goal = 1e-8 * rho;
        for _ in 0..(3 * n).min(400) {
            if rho <= goal || rho <= 0.0 {
                break;
            }
            let mut q = self.times(&p);
            shape.project(&mut q);
            let bend = dot(&p, &q);
            if bend <= 0.0 {
                break;
            }
            let step = rho / bend;
            for i in 0..n {
                x[i] += p[i] * step;
                r[i] -= q[i] * step;
            }
            z = apply(&r);
            let next = dot(&r, &z);
            let turn = next / rho;
            rho = next;
            for i in 0..n {
                p[i] = z[i] + p[i] * turn;
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::random::Random;

    #[test]
    fn the_gradient_of_quality_is_its_derivative() {
        let mut random = Random::new(3);
        for _ in 0..50 {
            let x = [0; 3].map(|_| random.point());
            let (q, gradient) = quality([&x[0], &x[1], &x[2]]);
            for k in 0..3 {
                for axis in 0..3 {
                    let mut moved = x;
                    moved[k][axis] += 1e-6;
                    let found = (quality([&moved[0], &moved[1], &moved[2]]).0 - q) / 1e-6;
                    assert!((found - gradient[k][axis]).abs() < 1e-4 * (1.0 + gradient[k].norm()));
                }
            }
        }
    }

    #[test]
    fn a_section_is_drawn_back_along_its_limb_and_no_further() {
        let ring = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        let cage: Vec<Point> = ring.map(|(y, z)| Point::new(0.1 * y, y, z)).to_vec();
        let along = Point::x();
        let sections = [Station { vertices: vec![0, 1, 2, 3], along, place: 0.5 }];
        let shape = Shape {
            faces: &[],
            others: &[],
            edges: &[],
            rest: &cage,
            mirror: None,
            moves: &[],
            sections: &sections,
        };
        let w = Weights {
            shape: 0.0,
            anchor: 0.0,
            slide: 1.0,
            volume: 0.0,
            quality: 0.0,
            reach: 1.0,
            least: 0.0,
        };
        let points = Points { cage: &cage, obstacle: &[] };
        assert!((energy(&shape, &points, &[], &w) - 0.125).abs() < 1e-12);
        for step in newton_step(&shape, &points, &[], &w) {
            assert!((step - along * 0.5).norm() < 1e-6, "{step}");
        }
    }

    #[test]
    fn the_barrier_is_smooth_where_it_ends() {
        let (value, slope, _) = barrier(0.999_999, 1.0);
        assert!(value.abs() < 1e-9 && slope.abs() < 1e-9 && barrier(1e-6, 1.0).1 < -1e5);
    }
}
