//! Is a point inside a closed triangle mesh? Counts crossings of a ray along +x.
//!
//! An edge is crossed by the half-open rule of scan conversion and with its ends in one order,
//! whichever triangle asks: neighbours agree to the last bit, so a ray through an edge or a corner
//! is counted once. A point looks at the triangles of its slab along z.

use crate::points::Point;

/// A closed triangle mesh, asked about many points.
pub struct Enclosure<'a> {
    vertices: &'a [Point],
    /// The triangles that each slab has a part of.
    slabs: Vec<Vec<[u32; 3]>>,
    low: f64,
    high: f64,
}

/// Most slabs.
const SLABS: usize = 1024;

impl<'a> Enclosure<'a> {
    /// The volume that `triangles` over `vertices` (`#V by 3`) enclose.
    pub fn new(vertices: &'a [Point], triangles: &'a [[u32; 3]]) -> Self {
        let heights = |corners: &[u32; 3]| corners.map(|v| vertices[v as usize].z);
        let all = triangles.iter().flat_map(heights);
        let (low, high) =
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (z.min(low), z.max(high)));
        let slabs = vec![Vec::new(); triangles.len().clamp(1, SLABS)];
        let mut enclosure = Self { vertices, slabs, low, high };
        for corners in triangles {
            let [a, b, c] = heights(corners).map(|z| enclosure.slab(z));
            let (first, last) = (a.min(b).min(c), a.max(b).max(c));
            enclosure.slabs[first..=last].iter_mut().for_each(|slab| slab.push(*corners));
        }
        enclosure
    }

    /// Whether `point` is inside. On the surface it may be either.
    pub fn contains(&self, point: &Point) -> bool {
        if !(self.low..=self.high).contains(&point.z) {
            return false;
        }
        let slab = self.slabs[self.slab(point.z)].iter();
        slab.filter(|corners| self.is_crossed(corners, point)).count() % 2 == 1
    }

    /// The slab of a height. Never falls as heights rise, so a triangle's are all between its corners'.
    fn slab(&self, z: f64) -> usize {
        let part = (z - self.low) / (self.high - self.low);
        ((part * self.slabs.len() as f64) as usize).min(self.slabs.len() - 1)
    }

    /// Whether the ray from `point` along +x crosses the triangle.
    fn is_crossed(&self, corners: &[u32; 3], point: &Point) -> bool {
        let [a, b, c] = corners.map(|v| self.vertices[v as usize]);
        if a.x.max(b.x).max(c.x) < point.x {
            return false;
        }
        let sides = [(corners[0], corners[1]), (corners[1], corners[2]), (corners[2], corners[0])];
        // In the plane of y and z, a ray along +y from the point crosses one side or none.
        if sides.iter().filter(|side| self.is_side_crossed(**side, point)).count() % 2 == 0 {
            return false;
        }
        let normal = (b - a).cross(&(c - a));
        (point - a).dot(&normal) * normal.x < 0.0
    }

    fn is_side_crossed(&self, (a, b): (u32, u32), point: &Point) -> bool {
        let (a, b) = (self.vertices[a.min(b) as usize], self.vertices[a.max(b) as usize]);
        if (a.z <= point.z) == (b.z <= point.z) {
            return false;
        }
        a.y + (point.z - a.z) / (b.z - a.z) * (b.y - a.y) > point.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{random::Random, shapes::icosphere};

    #[test]
    fn a_sphere_contains_what_is_nearer_than_its_faces() {
        let (vertices, triangles) = icosphere(2);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v as u32)).collect();
        let sphere = Enclosure::new(&vertices, &triangles);
        let mut random = Random::new(3);
        for _ in 0..2000 {
            let direction = random.point().normalize();
            assert!(sphere.contains(&(direction * 0.9)));
            assert!(!sphere.contains(&(direction * 1.01)));
        }
    }

    #[test]
    fn rays_through_corners_and_edges_are_counted_once() {
        // A cube whose corners, edges and face diagonals the rays hit exactly.
        let corner = |k: usize| Point::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2 & 1) as f64);
        let vertices: Vec<Point> = (0..8).map(corner).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[u32; 3]> =
            quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        let cube = Enclosure::new(&vertices, &triangles);
        for n in 0..27 {
            let grid = |k: usize| 0.5 * ((n / k) % 3) as f64;
            let (y, z) = (grid(1), grid(3));
            let x = grid(9) - 0.25;
            assert!(!cube.contains(&Point::new(-0.25, y, z)) && !cube.contains(&Point::new(1.25, y, z)));
            let within = (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y) && (0.0..1.0).contains(&z);
            assert_eq!(cube.contains(&Point::new(x, y, z)), within, "{x} {y} {z}");
        }
    }
}
