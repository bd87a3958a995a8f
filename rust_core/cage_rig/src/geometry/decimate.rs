//! Fewer triangles for the same shape: edges collapse where it costs the least.
//!
//! Quadric error metrics (Garland, Heckbert 1997) with the link condition, so that the result is
//! manifold with the same genus, and no face turns over. `n log n`.

use crate::points::{Matrix3, Point};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A closed mesh with at most about `target` triangles. `vertices`: `#V by 3`.
pub fn decimate(vertices: &[Point], triangles: &[[u32; 3]], target: usize) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut work = Work::new(vertices, triangles);
    while work.alive > target {
        let Some(next) = work.heap.pop() else { break };
        let (a, b) = next.edge;
        if next.stamps == [work.stamps[a as usize], work.stamps[b as usize]] {
            work.collapse(a, b, next.place);
        }
    }
    work.result()
}

/// Sum of squared distances to planes: `pᵀ A p + 2 b p + c`.
#[derive(Clone, Copy)]
struct Quadric {
    a: Matrix3,
    b: Point,
    c: f64,
}

impl Quadric {
    fn plane(normal: Point, through: &Point, weight: f64) -> Self {
        let d = -normal.dot(through);
        Self { a: normal * normal.transpose() * weight, b: normal * d * weight, c: d * d * weight }
    }

    fn plus(&self, other: &Self) -> Self {
        Self { a: self.a + other.a, b: self.b + other.b, c: self.c + other.c }
    }

    fn at(&self, p: &Point) -> f64 {
        (p.dot(&(self.a * p)) + 2.0 * self.b.dot(p) + self.c).max(0.0)
    }

    /// The place of least error, near `middle` where the quadric does not say.
    fn best(&self, middle: &Point, length: f64) -> Point {
        let soft = self.a + Matrix3::identity() * (1e-6 * self.a.trace() + 1e-300);
        let right = -(self.b + self.a * middle);
        match soft.cholesky() {
            Some(factor) => {
                let step = factor.solve(&right);
                if step.norm() <= length {
                    middle + step
                } else {
                    *middle
                }
            }
            None => *middle,
        }
    }
}

struct Candidate {
    cost: f64,
    edge: (u32, u32),
    stamps: [u32; 2],
    place: Point,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    // The cheapest first; equal costs in the order of their edges.
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then_with(|| other.edge.cmp(&self.edge))
    }
}

struct Work {
    points: Vec<Point>,
    quadrics: Vec<Quadric>,
    faces: Vec<Option<[u32; 3]>>,
    around: Vec<Vec<u32>>,
    stamps: Vec<u32>,
    heap: BinaryHeap<Candidate>,
    alive: usize,
}

impl Work {
    fn new(vertices: &[Point], triangles: &[[u32; 3]]) -> Self {
        let zero = Quadric { a: Matrix3::zeros(), b: Point::zeros(), c: 0.0 };
        let mut work = Self {
            points: vertices.to_vec(),
            quadrics: vec![zero; vertices.len()],
            faces: triangles.iter().copied().map(Some).collect(),
            around: vec![Vec::new(); vertices.len()],
            stamps: vec![0; vertices.len()],
            heap: BinaryHeap::new(),
            alive: triangles.len(),
        };
        for (at, t) in triangles.iter().enumerate() {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            let normal = (b - a).cross(&(c - a));
            let area = normal.norm();
            let plane = Quadric::plane(normal / area.max(1e-300), &a, area);
            for v in t {
                work.quadrics[*v as usize] = work.quadrics[*v as usize].plus(&plane);
                work.around[*v as usize].push(at as u32);
            }
        }
        for t in triangles {
            for k in 0..3 {
                if t[k] < t[(k + 1) % 3] {
                    work.offer(t[k], t[(k + 1) % 3]);
                }
            }
        }
        work
    }

    fn offer(&mut self, a: u32, b: u32) {
        let (p, q) = (self.points[a as usize], self.points[b as usize]);
        let both = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        let length = (q - p).norm();
        let place = both.best(&((p + q) * 0.5), length);
        let cost = both.at(&place) + 1e-9 * length * length * length * length;
        let stamps = [self.stamps[a as usize], self.stamps[b as usize]];
        if cost.is_finite() {
            self.heap.push(Candidate { cost, edge: (a, b), stamps, place });
        }
    }

    fn ring(&self, v: u32) -> Vec<u32> {
        let faces = self.around[v as usize].iter().filter_map(|f| self.faces[*f as usize]);
        let mut ring: Vec<u32> = faces.flatten().filter(|w| *w != v).collect();
        ring.sort_unstable();
        ring.dedup();
        ring
    }

    fn turns_over(&self, v: u32, other: u32, place: &Point) -> bool {
        self.around[v as usize].iter().filter_map(|f| self.faces[*f as usize]).any(|t| {
            if t.contains(&other) {
                return false;
            }
            let old = t.map(|w| self.points[w as usize]);
            let new = t.map(|w| if w == v { *place } else { self.points[w as usize] });
            let normal = |[a, b, c]: [Point; 3]| (b - a).cross(&(c - a));
            let (n, m) = (normal(old), normal(new));
            n.dot(&m) < 0.2 * n.norm() * m.norm()
        })
    }

    fn collapse(&mut self, a: u32, b: u32, place: Point) {
        let (ring_a, ring_b) = (self.ring(a), self.ring(b));
        let common = ring_a.iter().filter(|v| ring_b.binary_search(v).is_ok()).count();
        if common != 2 || ring_b.len() + ring_a.len() < 8 {
            return;
        }
        if self.turns_over(a, b, &place) || self.turns_over(b, a, &place) {
            return;
        }
        self.points[a as usize] = place;
        self.quadrics[a as usize] = self.quadrics[a as usize].plus(&self.quadrics[b as usize]);
        for at in std::mem::take(&mut self.around[b as usize]) {
            let Some(face) = self.faces[at as usize].as_mut() else { continue };
            if face.contains(&a) {
                self.faces[at as usize] = None;
                self.alive -= 1;
            } else {
                face.iter_mut().filter(|v| **v == b).for_each(|v| *v = a);
                self.around[a as usize].push(at);
            }
        }
        let faces = &self.faces;
        self.around[a as usize].retain(|f| faces[*f as usize].is_some());
        self.stamps[a as usize] += 1;
        self.stamps[b as usize] += 1;
        for v in self.ring(a) {
            self.offer(a.min(v), a.max(v));
        }
    }

    fn result(&self) -> (Vec<Point>, Vec<[u32; 3]>) {
        let mut place = vec![u32::MAX; self.points.len()];
        let mut points = Vec::new();
        let mut triangles = Vec::with_capacity(self.alive);
        for face in self.faces.iter().flatten() {
            triangles.push(face.map(|v| {
                if place[v as usize] == u32::MAX {
                    place[v as usize] = points.len() as u32;
                    points.push(self.points[v as usize]);
                }
                place[v as usize]
            }));
        }
        (points, triangles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::shapes::icosphere;

    #[test]
    fn a_sphere_stays_a_closed_sphere() {
        let (vertices, triangles) = icosphere(4);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v as u32)).collect();
        let (points, faces) = decimate(&vertices, &triangles, 400);
        assert!(faces.len() <= 400 && faces.len() > 390);
        assert_eq!(faces.len(), 2 * points.len() - 4);
        assert!(points.iter().all(|p| (p.norm() - 1.0).abs() < 0.03));
        let mut edges: Vec<(u32, u32)> =
            faces.iter().flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]).collect();
        edges.sort_unstable();
        assert!(edges.windows(2).all(|w| w[0] != w[1]));
        assert!(edges.iter().all(|(a, b)| edges.binary_search(&(*b, *a)).is_ok()));
    }
}
