//! A start without any crossing: the skin drawn into a thin thread along the cage's axis.
//!
//! Every skin vertex gets a place on the axis graph: vertices at the ring of a section that of its
//! control node, the others by repeated averaging over neighbours with midpoints measured *along the
//! graph* (a harmonic map into a graph; no chord across a concavity, loops and branchings included).
//! The skin is scaled about its places on the axis until it is inside the cage, whose sections the
//! caller scales about their centers until it is free of itself. About `600 · #vertices` table look-ups.

use super::sections::Section;
use super::tubes::{Axis, Scaffold};
use super::verify;
use crate::geometry::bvh::Bvh;
use crate::points::Point;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

const SWEEPS: usize = 350;
/// Sweeps after the rings are let go, so that no edge between two rings jumps past their branching.
const FREE_SWEEPS: usize = 200;

/// Where inflation starts. Unit space.
pub(crate) struct Start {
    /// Scale of the sections about their centers.
    pub(crate) scale: f64,
    pub(crate) cage: Vec<Point>,
    /// The contracted obstacle, inside the cage.
    pub(crate) obstacle: Vec<Point>,
}

/// Contracts the obstacle `points` with `triangles` into `scaffold` with its sections scaled by
/// `scale`; else a cage vertex at the fault.
pub(crate) fn start(
    scaffold: &Scaffold,
    sections: &[Section],
    points: &[Point],
    triangles: &[[u32; 3]],
    scale: f64,
) -> Result<Start, usize> {
    let faces = scaffold.triangles();
    let cage = scaffold.scaled(scale);
    if let Some(vertex) = verify::first_self_crossing(&cage, &faces) {
        return Err(vertex as usize);
    }
    let places = places(scaffold, sections, points, triangles);
    let tree = Bvh::new(&cage, &faces);
    let mut fault = 0;
    for shrink in [0.1, 0.01, 0.001] {
        let shrunk = |(p, q): (&Point, &Point)| q + (p - q) * (shrink * (2.0 * scale).min(1.0));
        let obstacle: Vec<Point> = points.iter().zip(&places).map(shrunk).collect();
        match verify::first_outside(&tree, &cage, &obstacle, triangles) {
            None => return Ok(Start { scale, cage, obstacle }),
            Some(vertex) => fault = vertex as usize,
        }
    }
    Err(fault)
}

/// For each obstacle vertex, its place on the axis.
fn places(scaffold: &Scaffold, sections: &[Section], points: &[Point], triangles: &[[u32; 3]]) -> Vec<Point> {
    let graph = Samples::new(&scaffold.axis);
    let tree = Bvh::new(points, triangles);
    let mut fixed = vec![u32::MAX; points.len()];
    for (node, section) in sections.iter().enumerate() {
        for p in &section.ring {
            if let Some(near) = tree.nearest(points, p) {
                let corners = triangles[near.triangle];
                let nearest = corners.iter().min_by(|a, b| {
                    (points[**a as usize] - p).norm().total_cmp(&(points[**b as usize] - p).norm())
                });
                if let Some(v) = nearest {
                    fixed[*v as usize] = node as u32;
                }
            }
        }
    }
    let neighbours = neighbours(points.len(), triangles);
    let mut at = spread(points, &neighbours, &fixed);
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut next = move |n: usize| {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        ((random >> 33) as usize) % n
    };
    for sweep in 0..SWEEPS + FREE_SWEEPS {
        for v in 0..points.len() {
            let around = &neighbours[v];
            if (fixed[v] == u32::MAX || sweep >= SWEEPS) && !around.is_empty() {
                let other = at[around[next(around.len())] as usize];
                at[v] = graph.middle(at[v], other);
            }
        }
    }
    // A last pass in space, over the noise of the random choices.
    let mut smooth: Vec<Point> = at.iter().map(|s| graph.points[*s as usize]).collect();
    for _ in 0..3 {
        let old = smooth.clone();
        for (v, around) in neighbours.iter().enumerate() {
            let near =
                around.iter().filter(|w| graph.distance(at[v], at[**w as usize]) < 2.5 * graph.spacing);
            let (sum, count) = near.fold((old[v], 1.0), |(s, n), w| (s + old[*w as usize], n + 1.0));
            smooth[v] = sum / count;
        }
    }
    smooth
}

fn neighbours(count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut found = vec![Vec::new(); count];
    for t in triangles {
        for k in 0..3 {
            found[t[k] as usize].push(t[(k + 1) % 3]);
        }
    }
    found
}

/// The nearest fixed vertex's node for every vertex, by distance along edges.
fn spread(points: &[Point], neighbours: &[Vec<u32>], fixed: &[u32]) -> Vec<u32> {
    let mut at = vec![0; points.len()];
    let mut best = vec![f64::INFINITY; points.len()];
    let mut heap = BinaryHeap::new();
    for (v, node) in fixed.iter().enumerate().filter(|(_, n)| **n != u32::MAX) {
        best[v] = 0.0;
        at[v] = *node;
        heap.push(Reverse((0_u64, v)));
    }
    while let Some(Reverse((bits, v))) = heap.pop() {
        if f64::from_bits(bits) > best[v] {
            continue;
        }
        for w in neighbours[v].iter().map(|w| *w as usize) {
            let length = best[v] + (points[w] - points[v]).norm();
            if length < best[w] {
                best[w] = length;
                at[w] = at[v];
                // Distances are not negative, so their bits are in order.
                heap.push(Reverse((length.to_bits(), w)));
            }
        }
    }
    at
}

/// Points close together along a graph, with all distances and midpoints. The graph's own points
/// come first.
struct Samples {
    points: Vec<Point>,
    distances: Vec<f32>,
    middles: Vec<u16>,
    spacing: f64,
}

impl Samples {
    fn new(axis: &Axis) -> Self {
        let length: f64 = axis.edges.iter().map(|(a, b)| (axis.points[*a] - axis.points[*b]).norm()).sum();
        let spacing = (length / 450.0).max(1e-4);
        let mut points = axis.points.clone();
        let mut links: Vec<Vec<(usize, f64)>> = vec![Vec::new(); points.len()];
        for &(a, b) in &axis.edges {
            let (p, q) = (axis.points[a], axis.points[b]);
            let pieces = ((q - p).norm() / spacing).ceil().max(1.0) as usize;
            let mut last = a;
            for k in 1..=pieces {
                let next = if k == pieces { b } else { points.len() };
                if k < pieces {
                    points.push(p + (q - p) * (k as f64 / pieces as f64));
                    links.push(Vec::new());
                }
                let step = (points[next] - points[last]).norm();
                links[last].push((next, step));
                links[next].push((last, step));
                last = next;
            }
        }
        let n = points.len();
        let (mut distances, mut middles) = (Vec::with_capacity(n * n), vec![0; n * n]);
        for from in 0..n {
            let (distance, before) = shortest(&links, from);
            for to in 0..n {
                let mut k = to;
                while k != from && distance[k] > 0.5 * distance[to] + 1e-12 && distance[k].is_finite() {
                    k = before[k];
                }
                middles[from * n + to] = k as u16;
            }
            distances.extend(distance.iter().map(|d| *d as f32));
        }
        Self { points, distances, middles, spacing }
    }

    fn middle(&self, a: u32, b: u32) -> u32 {
        u32::from(self.middles[a as usize * self.points.len() + b as usize])
    }

    fn distance(&self, a: u32, b: u32) -> f64 {
        f64::from(self.distances[a as usize * self.points.len() + b as usize])
    }
}

fn shortest(links: &[Vec<(usize, f64)>], from: usize) -> (Vec<f64>, Vec<usize>) {
    let mut distance = vec![f64::INFINITY; links.len()];
    let mut before = vec![from; links.len()];
    let mut heap = BinaryHeap::from([Reverse((0_u64, from))]);
    distance[from] = 0.0;
    while let Some(Reverse((bits, v))) = heap.pop() {
        if f64::from_bits(bits) > distance[v] {
            continue;
        }
        for &(w, step) in &links[v] {
            let length = distance[v] + step;
            if length < distance[w] {
                distance[w] = length;
                before[w] = v;
                heap.push(Reverse((length.to_bits(), w)));
            }
        }
    }
    (distance, before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn midpoints_are_measured_along_the_graph() {
        let points = vec![Point::zeros(), Point::x(), Point::new(1.0, 1.0, 0.0), Point::y()];
        let axis = Axis { points, edges: vec![(0, 1), (1, 2), (2, 3)] };
        let graph = Samples::new(&axis);
        let middle = graph.points[graph.middle(0, 3) as usize];
        assert!((middle - Point::new(1.0, 0.5, 0.0)).norm() < 0.02, "{middle}");
    }
}
