//! The stand-in that the cage grows around: the skin with a manageable number of triangles.
//!
//! A fine skin is decimated, and the cage keeps a margin that covers what sticks out of the stand-in;
//! a coarse one is subdivided, which leaves its surface as it is, so that it bends with the axis.

use super::skin::Skin;
use crate::geometry::bvh::Bvh;
use crate::geometry::decimate::decimate;
use crate::points::Point;
use rayon::prelude::*;
use std::collections::HashMap;

/// Triangles that growth is quick with.
const MANY: usize = 9000;
const FEW: usize = 2000;

/// Vertices and triangles, unit space.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) points: Vec<Point>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// The stand-in, and how far the skin sticks out of it.
pub(crate) fn proxy(skin: &Skin) -> (Mesh, f64) {
    if skin.triangles.len() > MANY {
        let (points, triangles) = decimate(&skin.points, &skin.triangles, MANY * 2 / 3);
        let tree = Bvh::new(&points, &triangles);
        let out = |p: &Point| match tree.winding(&points, p) {
            0 => tree.nearest(&points, p).map_or(0.0, |n| n.distance),
            _ => 0.0,
        };
        let margin = skin.points.par_iter().map(out).reduce(|| 0.0, f64::max);
        return (Mesh { points, triangles }, margin);
    }
    let mut mesh = Mesh { points: skin.points.clone(), triangles: skin.triangles.clone() };
    while mesh.triangles.len() < FEW {
        mesh.subdivide();
    }
    (mesh, 0.0)
}

impl Mesh {
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
