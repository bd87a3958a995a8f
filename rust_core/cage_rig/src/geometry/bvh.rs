//! A tree of boxes over triangles: which are near, which is nearest, which are crossed by a line.
//!
//! Median splits, leaves of four; [`Bvh::refit`] follows moved vertices. Building is
//! `n log n`, a query about `log n`.

use super::distance::nearest_on_triangle;
use super::predicates::turn;
use crate::points::Point;

const LEAF: usize = 4;

/// Boxes over the triangles of a mesh. Queries take the vertices that it was last fitted to.
#[derive(Debug, Clone)]
pub struct Bvh {
    triangles: Vec<[u32; 3]>,
    order: Vec<u32>,
    nodes: Vec<Node>,
}

/// A leaf has `count` triangles from `first` on in the order; an inner node's children are the
/// next node and node `first`.
#[derive(Debug, Clone)]
struct Node {
    low: Point,
    high: Point,
    first: u32,
    count: u32,
}

/// The nearest point of a mesh.
#[derive(Debug, Clone, Copy)]
pub struct Nearest {
    /// Distance to it.
    pub distance: f64,
    /// Where it is.
    pub point: Point,
    /// The triangle it is on.
    pub triangle: usize,
}

/// A line parallel to an axis crosses the mesh here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Coordinate along the axis.
    pub at: f64,
    /// 1 where the line goes in (through an outward face from its front), −1 where it goes out.
    pub sign: i32,
}

impl Bvh {
    /// Boxes over `triangles` of `vertices` (`#V by 3`).
    pub fn new(vertices: &[Point], triangles: &[[u32; 3]]) -> Self {
        let center = |t: &[u32; 3]| t.iter().map(|v| vertices[*v as usize]).sum::<Point>() / 3.0;
        let centers: Vec<Point> = triangles.iter().map(center).collect();
        let mut tree = Self {
            triangles: triangles.to_vec(),
            order: (0..triangles.len() as u32).collect(),
            nodes: Vec::with_capacity(triangles.len()),
        };
        if !triangles.is_empty() {
            tree.split(&centers, 0, triangles.len());
        }
        tree.refit(vertices);
        tree
    }

    /// The triangles, as given.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    fn split(&mut self, centers: &[Point], start: usize, end: usize) {
        let at = self.nodes.len();
        let (first, count) = (start as u32, (end - start) as u32);
        self.nodes.push(Node { low: Point::zeros(), high: Point::zeros(), first, count });
        if end - start <= LEAF {
            return;
        }
        let part = &mut self.order[start..end];
        let start_box = (Point::repeat(f64::INFINITY), Point::repeat(f64::NEG_INFINITY));
        let (low, high) = part.iter().fold(start_box, |(low, high), t| {
            (low.inf(&centers[*t as usize]), high.sup(&centers[*t as usize]))
        });
        let axis = (high - low).imax();
        let middle = part.len() / 2;
        part.select_nth_unstable_by(middle, |a, b| {
            centers[*a as usize][axis].total_cmp(&centers[*b as usize][axis]).then(a.cmp(b))
        });
        self.split(centers, start, start + middle);
        self.nodes[at].first = self.nodes.len() as u32;
        self.nodes[at].count = 0;
        self.split(centers, start + middle, end);
    }

    /// Fits the boxes to moved vertices.
    pub fn refit(&mut self, vertices: &[Point]) {
        for at in (0..self.nodes.len()).rev() {
            let Node { first, count, .. } = self.nodes[at];
            let (low, high) = if count > 0 {
                let mut bounds = (Point::repeat(f64::INFINITY), Point::repeat(f64::NEG_INFINITY));
                for t in &self.order[first as usize..(first + count) as usize] {
                    for v in self.triangles[*t as usize] {
                        let p = &vertices[v as usize];
                        bounds = (bounds.0.inf(p), bounds.1.sup(p));
                    }
                }
                bounds
            } else {
                let (a, b) = (&self.nodes[at + 1], &self.nodes[first as usize]);
                (a.low.inf(&b.low), a.high.sup(&b.high))
            };
            (self.nodes[at].low, self.nodes[at].high) = (low, high);
        }
    }

    /// Calls `found` with each triangle in a leaf that `enters` lets through (box: low, high).
    fn visit(&self, mut enters: impl FnMut(&Point, &Point) -> bool, mut found: impl FnMut(u32)) {
        let mut stack = vec![0];
        while let Some(at) = stack.pop() {
            let Some(node) = self.nodes.get(at) else { continue };
            if !enters(&node.low, &node.high) {
                continue;
            }
            if node.count > 0 {
                self.order[node.first as usize..(node.first + node.count) as usize]
                    .iter()
                    .for_each(|t| found(*t));
            } else {
                stack.push(node.first as usize);
                stack.push(at + 1);
            }
        }
    }

    /// Triangles whose boxes may come within `radius` of the triangle `corners`: by its box, its
    /// plane and the planes through its sides.
    pub fn near_triangle(&self, corners: [&Point; 3], radius: f64, mut found: impl FnMut(u32)) {
        let [a, b, c] = corners;
        let reach = Point::repeat(radius);
        let (low, high) = (a.inf(b).inf(c) - reach, a.sup(b).sup(c) + reach);
        let mut slabs: Vec<(Point, f64, f64)> = Vec::with_capacity(4);
        if let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-300) {
            slabs.push((normal, normal.dot(a), normal.dot(a)));
            for (p, q, r) in [(a, b, c), (b, c, a), (c, a, b)] {
                if let Some(inward) = normal.cross(&(q - p)).try_normalize(1e-300) {
                    let (s, t) = (inward.dot(p), inward.dot(r));
                    slabs.push((inward, s.min(t), s.max(t)));
                }
            }
        }
        let enters = |l: &Point, h: &Point| {
            if (0..3).any(|k| l[k] > high[k] || h[k] < low[k]) {
                return false;
            }
            let (center, half) = ((l + h) * 0.5, (h - l) * 0.5);
            slabs.iter().all(|(n, from, to)| {
                let (at, spread) = (n.dot(&center), n.abs().dot(&half) + radius);
                at + spread >= *from && at - spread <= *to
            })
        };
        self.visit(enters, &mut found);
    }

    /// Triangles whose leaf's box overlaps the box from `low` to `high`.
    pub fn in_box(&self, low: &Point, high: &Point, found: impl FnMut(u32)) {
        self.visit(|l, h| (0..3).all(|k| l[k] <= high[k] && h[k] >= low[k]), found);
    }

    /// The nearest point of the mesh; `None` when it has no triangles.
    pub fn nearest(&self, vertices: &[Point], point: &Point) -> Option<Nearest> {
        let gap =
            |node: &Node| (node.low - point).sup(&(point - node.high)).sup(&Point::zeros()).norm_squared();
        let mut best: Option<Nearest> = None;
        let mut squared = f64::INFINITY;
        let mut stack = vec![(0.0, 0_usize)];
        while let Some((distance, at)) = stack.pop() {
            let Some(node) = self.nodes.get(at) else { continue };
            if distance >= squared {
                continue;
            }
            if node.count == 0 {
                let (left, right) = (at + 1, node.first as usize);
                let (l, r) = (gap(&self.nodes[left]), gap(&self.nodes[right]));
                stack.extend(if l < r { [(r, right), (l, left)] } else { [(l, left), (r, right)] });
                continue;
            }
            for t in &self.order[node.first as usize..(node.first + node.count) as usize] {
                let [a, b, c] = self.triangles[*t as usize].map(|v| &vertices[v as usize]);
                let weights = nearest_on_triangle(point, [a, b, c]);
                let on = a * weights[0] + b * weights[1] + c * weights[2];
                let found = (on - point).norm_squared();
                if found < squared {
                    squared = found;
                    best = Some(Nearest { distance: found.sqrt(), point: on, triangle: *t as usize });
                }
            }
        }
        best
    }

    /// Where the line through `point` along `axis` crosses the mesh, in any order. By the half-open
    /// rule with exact turns: on a closed mesh neighbours agree, so that signs sum to nothing.
    pub fn crossings(&self, vertices: &[Point], point: &Point, axis: usize, found: &mut Vec<Crossing>) {
        found.clear();
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let enters = |l: &Point, h: &Point| {
            l[u] <= point[u] && point[u] <= h[u] && l[v] <= point[v] && point[v] <= h[v]
        };
        self.visit(enters, |t| {
            let corners = self.triangles[t as usize];
            let side = |k: usize| {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                is_passed(&vertices[a.min(b) as usize], &vertices[a.max(b) as usize], point, u, v)
            };
            if (0..3).filter(|k| side(*k)).count() != 1 {
                return;
            }
            let [a, b, c] = corners.map(|w| vertices[w as usize]);
            let normal = (b - a).cross(&(c - a));
            let flat = |p: Point| [p[u], p[v]];
            let sign = -i32::from(turn(flat(a), flat(b), flat(c)));
            if sign == 0 {
                return;
            }
            let steep = if normal[axis] == 0.0 { f64::MIN_POSITIVE } else { normal[axis] };
            let at = a[axis] + ((a[u] - point[u]) * normal[u] + (a[v] - point[v]) * normal[v]) / steep;
            let within = at.clamp(a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
            found.push(Crossing { at: within, sign });
        });
    }

    /// How many times the mesh winds around `point`: 0 outside, 1 inside (more where closed parts
    /// overlap). For closed meshes.
    pub fn winding(&self, vertices: &[Point], point: &Point) -> i32 {
        let mut found = Vec::new();
        self.crossings(vertices, point, 0, &mut found);
        found.iter().filter(|c| c.at <= point.x).map(|c| c.sign).sum()
    }
}

/// In the plane of `u` and `v`: does a ray from `point` along +u pass the side `a` `b`?
fn is_passed(a: &Point, b: &Point, point: &Point, u: usize, v: usize) -> bool {
    if (a[v] <= point[v]) == (b[v] <= point[v]) {
        return false;
    }
    let (lower, upper) = if a[v] < b[v] { (a, b) } else { (b, a) };
    turn([lower[u], lower[v]], [upper[u], upper[v]], [point[u], point[v]]) > 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{random::Random, shapes::icosphere};
    use crate::geometry::distance::squared_distance;

    fn sphere() -> (Vec<Point>, Vec<[u32; 3]>) {
        let (vertices, triangles) = icosphere(3);
        (vertices, triangles.iter().map(|t| t.map(|v| v as u32)).collect())
    }

    #[test]
    fn nearest_agrees_with_looking_at_every_triangle() {
        let (vertices, triangles) = sphere();
        let tree = Bvh::new(&vertices, &triangles);
        let mut random = Random::new(2);
        for _ in 0..200 {
            let p = random.point() * 2.0;
            let slow = triangles
                .iter()
                .map(|t| squared_distance(&p, t.map(|v| &vertices[v as usize])))
                .fold(f64::INFINITY, f64::min);
            let fast = tree.nearest(&vertices, &p).expect("not empty");
            assert!((fast.distance - slow.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_sphere_winds_once_around_what_is_inside() {
        let (vertices, triangles) = sphere();
        let tree = Bvh::new(&vertices, &triangles);
        let mut random = Random::new(4);
        for _ in 0..500 {
            let direction = random.point().normalize();
            assert_eq!(tree.winding(&vertices, &(direction * 0.97)), 1);
            assert_eq!(tree.winding(&vertices, &(direction * 1.01)), 0);
        }
        assert_eq!(tree.winding(&vertices, &Point::zeros()), 1);
        for v in &vertices {
            // Lines through corners and edges are counted once.
            assert_eq!(tree.winding(&vertices, &Point::new(-2.0, v.y, v.z)), 0);
            assert_eq!(tree.winding(&vertices, &Point::new(2.0, v.y, v.z)), 0);
            assert_eq!(tree.winding(&vertices, &Point::new(0.0, v.y * 0.9, v.z * 0.9)), 1);
        }
    }

    #[test]
    fn no_near_triangle_is_missed() {
        let (mut vertices, triangles) = sphere();
        let mut tree = Bvh::new(&vertices, &triangles);
        vertices.iter_mut().for_each(|v| v.z *= 0.3);
        tree.refit(&vertices);
        let mut random = Random::new(8);
        for _ in 0..100 {
            let corners: [Point; 3] = [0; 3].map(|_| random.point());
            let mut found = vec![false; triangles.len()];
            tree.near_triangle([&corners[0], &corners[1], &corners[2]], 0.1, |t| found[t as usize] = true);
            for (t, corners_of) in triangles.iter().enumerate() {
                let near = corners_of.iter().any(|v| {
                    squared_distance(&vertices[*v as usize], [&corners[0], &corners[1], &corners[2]]) < 0.01
                });
                assert!(!near || found[t]);
            }
        }
    }
}
