//! Stand-ins for the skin with a manageable number of triangles.
//!
//! The cage grows around one and is tightened around a finer one. A fine skin is decimated, and the
//! cage keeps a margin that covers what sticks out of the stand-in; a coarse one is subdivided, which
//! leaves its surface as it is, so that it bends with the axis.

use super::skin::Skin;
use crate::geometry::bvh::Bvh;
use crate::geometry::decimate::decimate;
use crate::points::Point;
use rayon::prelude::*;
use std::collections::HashMap;

/// Triangles that growth is quick with.
const MANY: usize = 9000;
const FEW: usize = 2000;

/// Triangles that tightening is quick with.
const FINE: usize = 25_000;

/// Vertices and triangles, unit space.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) points: Vec<Point>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// A mesh instead of the skin, and how far the skin sticks out of it.
#[derive(Debug, Clone)]
pub(crate) struct StandIn {
    pub(crate) mesh: Mesh,
    pub(crate) margin: f64,
}

/// What a cage is made around.
#[derive(Debug)]
pub(crate) struct Obstacles {
    /// Where it grows.
    pub(crate) growth: StandIn,
    /// Where it is tightened.
    pub(crate) tightening: StandIn,
}

impl Obstacles {
    pub(crate) fn of(skin: &Skin) -> Self {
        let whole = Mesh { points: skin.points.clone(), triangles: skin.triangles.clone() };
        let fine = if whole.triangles.len() > FINE * 5 / 4 { whole.decimated(FINE) } else { whole };
        let mut coarse =
            if fine.triangles.len() > MANY { fine.decimated(MANY * 2 / 3) } else { fine.clone() };
        while coarse.triangles.len() < FEW {
            coarse.subdivide();
        }
        let decimated = |mesh: &Mesh, of: usize| mesh.triangles.len() < of;
        let mut margins = [0.0; 2];
        if decimated(&fine, skin.triangles.len()) {
            margins[1] = fine.sticks_out(&skin.points);
        }
        if decimated(&coarse, fine.triangles.len()) {
            // Also of the finer stand-in: tightening begins where growth ended.
            margins[0] = coarse.sticks_out(&skin.points).max(coarse.sticks_out(&fine.points));
        }
        let [growth, tightening] = margins;
        Self {
            growth: StandIn { mesh: coarse, margin: growth },
            tightening: StandIn { mesh: fine, margin: tightening },
        }
    }
}

impl Mesh {
    fn decimated(&self, triangles: usize) -> Self {
        let (points, triangles) = decimate(&self.points, &self.triangles, triangles);
        Self { points, triangles }
    }

    /// How far any of `points` is outside.
    fn sticks_out(&self, points: &[Point]) -> f64 {
        let tree = Bvh::new(&self.points, &self.triangles);
        let out = |p: &Point| match tree.winding(&self.points, p) {
            0 => tree.nearest(&self.points, p).map_or(0.0, |n| n.distance),
            _ => 0.0,
        };
        points.par_iter().map(out).reduce(|| 0.0, f64::max)
    }

    /// Cuts every triangle into four at the middles of its sides.
    fn subdivide(&mut self) {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                let (a, b) = (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]));
                middles.entry((a, b)).or_insert_with(|| {
                    self.points.push((self.points[a as usize] + self.points[b as usize]) * 0.5);
                    self.points.len() as u32 - 1
                });
            }
        }
        self.split(&middles);
    }

    /// Halves edges until none is longer than `limit`.
    pub(crate) fn refine(&mut self, limit: f64) {
        loop {
            let mut middles = HashMap::new();
            for t in &self.triangles {
                for k in 0..3 {
                    let (a, b) = (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]));
                    let [p, q] = [a, b].map(|v| self.points[v as usize]);
                    if (q - p).norm() > limit && !middles.contains_key(&(a, b)) {
                        self.points.push((p + q) * 0.5);
                        middles.insert((a, b), self.points.len() as u32 - 1);
                    }
                }
            }
            if middles.is_empty() {
                return;
            }
            self.split(&middles);
        }
    }

    /// Cuts the triangles at points on their sides: `middles` has them by the ends of the side, the
    /// smaller first.
    pub(crate) fn split(&mut self, middles: &HashMap<(u32, u32), u32>) {
        let mut finer = Vec::with_capacity(self.triangles.len() + 2 * middles.len());
        for t in &self.triangles {
            let middle = |k: usize| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                middles.get(&(a.min(b), a.max(b))).copied()
            };
            // Turned so that the first side is cut, and the last is not where two are.
            let first = (0..3).find(|k| {
                middle(*k).is_some() && (middle((k + 2) % 3).is_none() || middle((k + 1) % 3).is_some())
            });
            let Some(k) = first else {
                finer.push(*t);
                continue;
            };
            let [a, b, c] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
            match (middle(k), middle((k + 1) % 3), middle((k + 2) % 3)) {
                (Some(p), Some(q), Some(r)) => finer.extend([[a, p, r], [p, b, q], [r, q, c], [p, q, r]]),
                (Some(p), Some(q), None) => finer.extend([[p, b, q], [a, p, q], [a, q, c]]),
                (Some(p), ..) => finer.extend([[a, p, c], [p, b, c]]),
                _ => finer.push(*t),
            }
        }
        self.triangles = finer;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::bvh::Bvh;

    #[test]
    fn splitting_some_sides_keeps_a_surface_closed_and_in_place() {
        let (points, triangles) = crate::fixtures::shapes::icosphere(1);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v as u32)).collect();
        for choice in 0..8 {
            let mut mesh = Mesh { points: points.clone(), triangles: triangles.clone() };
            let mut middles = HashMap::new();
            for t in &triangles[..5] {
                for k in (0..3).filter(|k| choice & (1 << k) != 0) {
                    let (a, b) = (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]));
                    if let std::collections::hash_map::Entry::Vacant(place) = middles.entry((a, b)) {
                        place.insert(mesh.points.len() as u32);
                        mesh.points.push((points[a as usize] + points[b as usize]) * 0.5);
                    }
                }
            }
            let count = middles.len();
            mesh.split(&middles);
            assert_eq!(mesh.triangles.len(), triangles.len() + 2 * count);
            let tree = Bvh::new(&mesh.points, &mesh.triangles);
            assert_eq!(tree.winding(&mesh.points, &Point::new(0.1, 0.2, 0.3)), 1);
            assert_eq!(tree.winding(&mesh.points, &Point::new(1.1, 0.2, 0.3)), 0);
        }
    }
}
