//! Points close together along the cage's axis, with all distances and midpoints along it.
//!
//! A table for every pair makes each look-up constant. `n² log n` to build, for about 600 points.

use super::tubes::Scaffold;
use crate::points::Point;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Points on the whole axis, and at least on every line of it.
const COUNT: f64 = 450.0;
const LEAST: f64 = 10.0;

/// The axis, sampled. The graph's own points come first.
pub(crate) struct Samples {
    pub(crate) points: Vec<Point>,
    /// How many points are the graph's own.
    pub(crate) nodes: usize,
    /// Neighbours with their distances.
    pub(crate) links: Vec<Vec<(usize, f64)>>,
    /// Length of the line that a point is on, the shortest at a node.
    pub(crate) room: Vec<f64>,
    /// Radius of the thinnest ring at the ends of that line.
    pub(crate) width: Vec<f64>,
    /// The line that a point is on: its ends and points in order, ends included.
    lines: Vec<Vec<u32>>,
    line: Vec<usize>,
    distances: Vec<f32>,
    middles: Vec<u16>,
}

impl Samples {
    /// Of the scaffold's axis, with the rings of its start.
    pub(crate) fn new(scaffold: &Scaffold) -> Self {
        let axis = &scaffold.axis;
        let length: f64 = axis.edges.iter().map(|(a, b)| (axis.points[*a] - axis.points[*b]).norm()).sum();
        let spacing = (length / COUNT).max(1e-4);
        let nodes = axis.points.len();
        let rings = ring_radii(scaffold);
        let mut found = Self {
            points: axis.points.clone(),
            nodes,
            links: vec![Vec::new(); nodes],
            room: vec![f64::INFINITY; nodes],
            width: rings.clone(),
            lines: Vec::new(),
            line: vec![usize::MAX; nodes],
            distances: Vec::new(),
            middles: Vec::new(),
        };
        for &(a, b) in &axis.edges {
            let (p, q) = (axis.points[a], axis.points[b]);
            let room = (q - p).norm();
            let width = rings[a].min(rings[b]);
            let pieces = (room / spacing).ceil().max(LEAST) as usize;
            let mut line = vec![a as u32];
            for k in 1..=pieces {
                let next = if k == pieces { b } else { found.points.len() };
                if k < pieces {
                    found.points.push(p + (q - p) * (k as f64 / pieces as f64));
                    found.links.push(Vec::new());
                    found.room.push(room);
                    found.width.push(width);
                    found.line.push(found.lines.len());
                }
                let last = line[line.len() - 1] as usize;
                let step = (found.points[next] - found.points[last]).norm();
                found.links[last].push((next, step));
                found.links[next].push((last, step));
                line.push(next as u32);
            }
            for end in [a, b] {
                found.room[end] = found.room[end].min(room);
                found.width[end] = found.width[end].min(width);
            }
            found.lines.push(line);
        }
        found.fill();
        found
    }

    fn fill(&mut self) {
        let n = self.points.len();
        let rows: Vec<(Vec<f32>, Vec<u16>)> = (0..n)
            .into_par_iter()
            .map(|from| {
                let (distance, before) = shortest(&self.links, from);
                let middle = |to: usize| {
                    let mut k = to;
                    while k != from && distance[k] > 0.5 * distance[to] + 1e-12 && distance[k].is_finite() {
                        k = before[k];
                    }
                    k as u16
                };
                (distance.iter().map(|d| *d as f32).collect(), (0..n).map(middle).collect())
            })
            .collect();
        for (distances, middles) in rows {
            self.distances.extend(distances);
            self.middles.extend(middles);
        }
    }

    /// Half way from `a` to `b` along the graph.
    pub(crate) fn middle(&self, a: u32, b: u32) -> u32 {
        u32::from(self.middles[a as usize * self.points.len() + b as usize])
    }

    /// From `a` to `b` along the graph.
    pub(crate) fn distance(&self, a: u32, b: u32) -> f64 {
        f64::from(self.distances[a as usize * self.points.len() + b as usize])
    }

    /// The nearest through space.
    pub(crate) fn nearest(&self, p: &Point) -> u32 {
        let distance = |s: &usize| (self.points[*s] - p).norm();
        (0..self.points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0) as u32
    }

    /// Where `s` comes when what is within `reach` of a node is drawn into it, and its line stretched.
    pub(crate) fn drawn_in(&self, s: u32, reach: &[f64]) -> u32 {
        let Some(line) = self.line.get(s as usize).and_then(|l| self.lines.get(*l)) else { return s };
        let [first, last] = [line[0], line[line.len() - 1]];
        let (from, to) = (reach[first as usize], reach[last as usize]);
        let length = self.room[s as usize];
        let x = (self.points[s as usize] - self.points[first as usize]).norm();
        let t = if length - from - to > 1e-9 { (x - from) / (length - from - to) } else { x / length };
        line[(t.clamp(0.0, 1.0) * (line.len() - 1) as f64).round() as usize]
    }
}

/// The least distance of a ring's sides from its center; branching nodes have the whole axis'.
fn ring_radii(scaffold: &Scaffold) -> Vec<f64> {
    let mut radii = vec![f64::INFINITY; scaffold.axis.points.len()];
    for (v, node) in scaffold.owner.iter().enumerate() {
        let radius = 0.5 * (scaffold.start[v] - scaffold.centers[*node]).norm();
        radii[*node] = radii[*node].min(radius);
    }
    radii
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
                // Distances are not negative, so their bits are in order.
                heap.push(Reverse((length.to_bits(), w)));
            }
        }
    }
    (distance, before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::tubes::Axis;

    fn staple() -> Samples {
        let points = vec![Point::zeros(), Point::x(), Point::new(1.0, 1.0, 0.0), Point::y()];
        Samples::new(&Scaffold {
            corners: Vec::new(),
            start: Vec::new(),
            owner: Vec::new(),
            centers: points.clone(),
            polygons: Vec::new(),
            axis: Axis { points, edges: vec![(0, 1), (1, 2), (2, 3)] },
        })
    }

    #[test]
    fn midpoints_are_measured_along_the_graph() {
        let graph = staple();
        let middle = graph.points[graph.middle(0, 3) as usize];
        assert!((middle - Point::new(1.0, 0.5, 0.0)).norm() < 0.02, "{middle}");
        assert!((graph.distance(0, 3) - 3.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_near_a_node_is_drawn_into_it() {
        let graph = staple();
        let at = |x: f64| graph.nearest(&Point::new(x, 0.0, 0.0));
        let reach = [0.0, 0.2, 0.0, 0.0];
        assert_eq!(graph.drawn_in(at(0.85), &reach), 1);
        let moved = graph.points[graph.drawn_in(at(0.4), &reach) as usize];
        assert!((moved - Point::new(0.5, 0.0, 0.0)).norm() < 0.02, "{moved}");
        assert_eq!(graph.drawn_in(at(0.0), &reach), 0);
    }
}
