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
/// Rounds of averaging around what still crosses the cage.
const REPAIRS: usize = 24;

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
    let tree = Bvh::new(&cage, &faces);
    let mut map = Map::new(scaffold, sections, points, triangles);
    let mut fault = 0;
    for round in 0..REPAIRS {
        let places = map.places();
        let shrink = if round < REPAIRS / 2 { 0.03 } else { 0.003 } * (2.0 * scale).min(1.0);
        let obstacle: Vec<Point> = points.iter().zip(&places).map(|(p, q)| q + (p - q) * shrink).collect();
        let crossing = verify::crossing(&tree, &cage, &obstacle, triangles);
        let Some((first, _)) = crossing.first() else {
            return match verify::first_outside(&tree, &cage, &obstacle, triangles) {
                None => Ok(Start { scale, cage, obstacle }),
                Some(vertex) => Err(vertex as usize),
            };
        };
        fault = *first as usize;
        // Edges that jump too far: their surroundings are averaged on, with nothing held.
        map.settle(crossing.iter().flat_map(|(_, t)| triangles[*t]));
    }
    Err(fault)
}

/// A map of the obstacle's vertices into the axis graph.
struct Map {
    graph: Samples,
    neighbours: Vec<Vec<u32>>,
    at: Vec<u32>,
    random: u64,
}

impl Map {
    fn new(scaffold: &Scaffold, sections: &[Section], points: &[Point], triangles: &[[u32; 3]]) -> Self {
        let tree = Bvh::new(points, triangles);
        let mut fixed = vec![u32::MAX; points.len()];
        for (node, section) in sections.iter().enumerate() {
            for p in &section.ring {
                let Some(near) = tree.nearest(points, p) else { continue };
                let distance = |v: &u32| (points[*v as usize] - p).norm();
                let corners = triangles[near.triangle];
                if let Some(v) = corners.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) {
                    fixed[*v as usize] = node as u32;
                }
            }
        }
        let neighbours = neighbours(points.len(), triangles);
        let at = spread(points, &neighbours, &fixed);
        let graph = Samples::new(&scaffold.axis);
        let mut map = Self { graph, neighbours, at, random: 0x2545_f491_4f6c_dd1d };
        let loose: Vec<usize> = (0..points.len()).filter(|v| fixed[*v] == u32::MAX).collect();
        map.average(&loose, SWEEPS);
        let all: Vec<usize> = (0..points.len()).collect();
        map.average(&all, FREE_SWEEPS);
        map
    }

    /// Moves each of `vertices` halfway to a neighbour, along the graph, `sweeps` times.
    fn average(&mut self, vertices: &[usize], sweeps: usize) {
        for _ in 0..sweeps {
            for &v in vertices {
                let around = &self.neighbours[v];
                if !around.is_empty() {
                    self.random ^= self.random << 13;
                    self.random ^= self.random >> 7;
                    self.random ^= self.random << 17;
                    let other = around[(self.random >> 33) as usize % around.len()];
                    self.at[v] = self.graph.middle(self.at[v], self.at[other as usize]);
                }
            }
        }
    }

    /// Averages around some vertices.
    fn settle(&mut self, vertices: impl Iterator<Item = u32>) {
        let mut near = vec![false; self.at.len()];
        vertices.for_each(|v| near[v as usize] = true);
        for _ in 0..4 {
            let old = near.clone();
            for (v, around) in self.neighbours.iter().enumerate() {
                near[v] = old[v] || around.iter().any(|w| old[*w as usize]);
            }
        }
        let marked: Vec<usize> = (0..near.len()).filter(|v| near[*v]).collect();
        self.average(&marked, 60);
    }

    /// The places in space, with a last pass over the noise of the random choices.
    fn places(&self) -> Vec<Point> {
        let graph = &self.graph;
        let mut smooth: Vec<Point> = self.at.iter().map(|s| graph.points[*s as usize]).collect();
        for _ in 0..3 {
            let old = smooth.clone();
            for (v, around) in self.neighbours.iter().enumerate() {
                let close =
                    |w: &&u32| graph.distance(self.at[v], self.at[**w as usize]) < 2.5 * graph.spacing;
                let near = around.iter().filter(close);
                let (sum, count) = near.fold((old[v], 1.0), |(s, n), w| (s + old[*w as usize], n + 1.0));
                smooth[v] = sum / count;
            }
        }
        smooth
    }
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
