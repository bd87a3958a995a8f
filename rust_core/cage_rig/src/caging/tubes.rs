//! From sections to a closed cage: tubes along arcs, hulls at branching nodes.
//!
//! [CLM*19 §7]. Two sections of an arc are joined by a strip of quads, in the rotation that brings
//! their corners nearest; at a branching node the corners of its sections are projected to a sphere
//! and joined by the convex hull there (exact predicates). A side of a section that the hull misses is
//! put in by flips, where the paper adds Steiner points and removes them again: the same faces
//! without the detour. The hull is star-shaped about its node, so it never crosses itself while
//! sections are small. Linear in the sections.

use super::control_nodes::{ControlNode, NodeKind};
use super::sections::Section;
use super::skeleton::CurveSkeleton;
use crate::geometry::convex_hull::hull_on_sphere;
use crate::geometry::predicates::side;
use crate::points::Point;

/// A cage grows so far beyond its sections before it is tightened.
pub(crate) const BEYOND: f64 = 1.05;

/// The middle of a branching node is looked for at steps of one part in so many between its sections;
/// half as many where there are more than these.
const PARTS: usize = 6;
const MANY: usize = 5;
/// A middle nearer to the plane of symmetry is on it.
const PLANE: f64 = 1e-9;

/// The faces of a cage and the axis inside it. Unit space.
#[derive(Debug, Clone)]
pub(crate) struct Scaffold {
    /// Corners of the sections, node after node.
    pub(crate) corners: Vec<Point>,
    /// The same corners on rings so small that nothing crosses: where the cage starts.
    pub(crate) start: Vec<Point>,
    /// The control node of each corner.
    pub(crate) owner: Vec<usize>,
    /// Center of each control node's section.
    pub(crate) centers: Vec<Point>,
    /// Quads and triangles, outward.
    pub(crate) polygons: Vec<Vec<u32>>,
    /// A graph of straight lines inside: centers of sections, then of branching nodes.
    pub(crate) axis: Axis,
}

/// A graph inside the cage.
#[derive(Debug, Clone, Default)]
pub(crate) struct Axis {
    pub(crate) points: Vec<Point>,
    pub(crate) edges: Vec<(usize, usize)>,
}

impl Scaffold {
    /// The polygons split into triangles, quads along the diagonal that keeps them convex.
    pub(crate) fn triangles(&self) -> Vec<[u32; 3]> {
        self.polygons.iter().flat_map(|p| split(&self.corners, p)).collect()
    }

    /// Corners on their way from the start to the sections, a little beyond at 1.
    pub(crate) fn grown(&self, part: f64) -> Vec<Point> {
        let grown = |((p, q), node): ((&Point, &Point), &usize)| {
            let target = self.centers[*node] + (p - self.centers[*node]) * BEYOND;
            q + (target - q) * part
        };
        self.corners.iter().zip(&self.start).zip(&self.owner).map(grown).collect()
    }
}

/// Triangles of a polygon: a quad by its outward diagonal, others as a fan.
pub(crate) fn split(points: &[Point], polygon: &[u32]) -> Vec<[u32; 3]> {
    if let [a, b, c, d] = polygon[..] {
        let [p, q, r, s] = [a, b, c, d].map(|v| &points[v as usize]);
        let volume = (q - p).cross(&(r - p)).dot(&(s - p));
        let size = (r - p).norm().max((s - q).norm()).powi(3);
        // Flat: the shorter diagonal, so that no sliver comes of it.
        let first = if volume.abs() < 1e-9 * size { (r - p).norm() <= (s - q).norm() } else { volume < 0.0 };
        return if first { vec![[a, b, c], [a, c, d]] } else { vec![[b, c, d], [b, d, a]] };
    }
    (1..polygon.len() - 1).map(|k| [polygon[0], polygon[k], polygon[k + 1]]).collect()
}

/// Joins the sections. Branches are star-shaped with the corners at `start`; else the junction that
/// can't be is returned.
pub(crate) fn scaffold(
    skeleton: &CurveSkeleton,
    nodes: &[ControlNode],
    sections: &[Section],
    start: Vec<Point>,
) -> Result<Scaffold, usize> {
    let count = sections.first().map_or(4, |s| s.corners.len());
    let centers: Vec<Point> = sections.iter().map(|s| s.center).collect();
    let mut built = Scaffold {
        corners: sections.iter().flat_map(|s| s.corners.iter().copied()).collect(),
        start,
        owner: (0..nodes.len()).flat_map(|n| vec![n; count]).collect(),
        axis: Axis { points: centers.clone(), edges: Vec::new() },
        centers,
        polygons: Vec::new(),
    };
    let ring = |node: usize| -> Vec<u32> { (0..count).map(|k| (node * count + k) as u32).collect() };
    let course = Course::new(skeleton, nodes);
    for &(a, b) in &course.strips {
        built.join(&ring(a), &ring(b));
    }
    built.axis.edges.extend(&course.strips);
    for &(node, away) in &course.caps {
        let mut cap = ring(node);
        if away {
            cap.reverse();
        }
        built.polygons.push(cap);
    }
    for (junction, members) in course.branches.iter().enumerate() {
        if members.len() >= 2 {
            let found = built.branch(&skeleton.junctions[junction].point, members, &ring);
            built.axis.meet(members, found.ok_or(junction)?);
        }
    }
    built.pull_leaves(nodes);
    Ok(built)
}

/// How control nodes follow one another.
struct Course {
    /// Neighbours on an arc.
    strips: Vec<(usize, usize)>,
    /// Leaves, and whether their arc leads away from its tip.
    caps: Vec<(usize, bool)>,
    /// For each junction what meets there, and whether its arc leads away from it.
    branches: Vec<Vec<(usize, bool)>>,
}

impl Course {
    fn new(skeleton: &CurveSkeleton, nodes: &[ControlNode]) -> Self {
        let branches = vec![Vec::new(); skeleton.junctions.len()];
        let mut found = Self { strips: Vec::new(), caps: Vec::new(), branches };
        for (at, arc) in skeleton.arcs.iter().enumerate() {
            let chain: Vec<usize> = (0..nodes.len()).filter(|n| nodes[*n].arc == at).collect();
            found.strips.extend(chain.windows(2).map(|w| (w[0], w[1])));
            for (end, away, node) in [(arc.ends[0], true, chain.first()), (arc.ends[1], false, chain.last())]
            {
                let Some(&node) = node else { continue };
                let closes = nodes[node].kind == NodeKind::Leaf && skeleton.junctions[end].degree == 1;
                let place = if closes { &mut found.caps } else { &mut found.branches[end] };
                place.push((node, away));
            }
        }
        found
    }
}

impl Axis {
    /// Of all edges.
    pub(crate) fn length(&self) -> f64 {
        self.edges.iter().map(|(a, b)| (self.points[*a] - self.points[*b]).norm()).sum()
    }

    /// Through the centers of sections and the branching nodes themselves.
    pub(crate) fn along(skeleton: &CurveSkeleton, nodes: &[ControlNode], centers: &[Point]) -> Self {
        let course = Course::new(skeleton, nodes);
        let mut axis = Self { points: centers.to_vec(), edges: course.strips };
        for (junction, members) in skeleton.junctions.iter().zip(&course.branches) {
            if members.len() >= 2 {
                axis.meet(members, junction.point);
            }
        }
        axis
    }

    /// Joins the ends of limbs.
    fn meet(&mut self, members: &[(usize, bool)], center: Point) {
        let at = self.points.len();
        self.points.push(center);
        self.edges.extend(members.iter().map(|(node, _)| (*node, at)));
    }
}

impl Scaffold {
    /// A strip of quads from ring `a` to ring `b`.
    fn join(&mut self, a: &[u32], b: &[u32]) {
        let n = a.len();
        let center = |r: &[u32]| r.iter().map(|v| self.corners[*v as usize]).sum::<Point>() / n as f64;
        let shift = center(b) - center(a);
        let cost = |turn: usize| -> f64 {
            (0..n)
                .map(|i| {
                    let (p, q) = (self.corners[a[i] as usize], self.corners[b[(i + turn) % n] as usize]);
                    (q - p - shift).norm_squared()
                })
                .sum()
        };
        let turn = (0..n).min_by(|x, y| cost(*x).total_cmp(&cost(*y))).unwrap_or(0);
        for i in 0..n {
            let j = (i + 1) % n;
            self.polygons.push(vec![a[i], a[j], b[(j + turn) % n], b[(i + turn) % n]]);
        }
    }

    /// The faces around a branching node; its center, moved until the sections surround it. `members`:
    /// control nodes and whether their arc leads away from the branching node.
    fn branch(
        &mut self,
        start: &Point,
        members: &[(usize, bool)],
        ring: &impl Fn(usize) -> Vec<u32>,
    ) -> Option<Point> {
        let sections: Vec<Point> = members.iter().map(|(node, _)| self.centers[*node]).collect();
        let rings: Vec<Vec<u32>> = members
            .iter()
            .map(|(node, away)| {
                let mut ring = ring(*node);
                if !away {
                    ring.reverse();
                }
                ring
            })
            .collect();
        let mut between: Vec<(f64, Point)> =
            between(start, &sections).into_iter().map(|p| (self.behind(&rings, &p), p)).collect();
        between.sort_by(|a, b| b.0.total_cmp(&a.0));
        for center in on_way(start, &sections).into_iter().chain(between.into_iter().map(|(_, p)| p)) {
            if let Some(faces) = self.star(&center, &rings) {
                self.polygons.extend(faces);
                return Some(center);
            }
        }
        None
    }

    /// How far a place is behind the rings, at their start.
    fn behind(&self, rings: &[Vec<u32>], place: &Point) -> f64 {
        let of_ring = |ring: &Vec<u32>| {
            let at = |k: usize| self.start[ring[k % ring.len()] as usize];
            let of_corner = |k: usize| {
                let across = (at(k + 1) - at(k)).cross(&(at(k + 2) - at(k + 1)));
                across.try_normalize(1e-12).map_or(f64::NEG_INFINITY, |n| (at(k) - place).dot(&n))
            };
            (0..ring.len()).map(of_corner).fold(f64::INFINITY, f64::min)
        };
        rings.iter().map(of_ring).fold(f64::INFINITY, f64::min)
    }

    /// Faces between the rings that are star-shaped about `center` at the start.
    fn star(&self, center: &Point, rings: &[Vec<u32>]) -> Option<Vec<Vec<u32>>> {
        let mut global = Vec::new();
        let mut points = Vec::new();
        let mut local: Vec<Vec<u32>> = Vec::new();
        for ring in rings {
            let first = points.len() as u32;
            for v in ring {
                points.push((self.start[*v as usize] - center).try_normalize(1e-9)?);
                global.push(*v);
            }
            local.push((first..points.len() as u32).collect());
        }
        let origin = Point::zeros();
        let at = |v: u32| &points[v as usize];
        // Each section must be seen from the center, convex and from behind.
        for ring in &local {
            let n = ring.len();
            let convex =
                (0..n).all(|i| side(at(ring[i]), at(ring[(i + 1) % n]), at(ring[(i + 2) % n]), &origin) > 0);
            if !convex {
                return None;
            }
        }
        let mut faces = hull_on_sphere(&points)?;
        if faces.iter().any(|f| side(at(f[0]), at(f[1]), at(f[2]), &origin) <= 0) {
            return None;
        }
        for ring in &local {
            for i in 0..ring.len() {
                insert_edge(&points, &mut faces, ring[i], ring[(i + 1) % ring.len()])?;
            }
        }
        let size = local[0].len() as u32;
        let within = |f: &[u32; 3]| f[0] / size == f[1] / size && f[1] / size == f[2] / size;
        let kept: Vec<[u32; 3]> = faces.iter().copied().filter(|f| !within(f)).collect();
        let removed = faces.len() - kept.len();
        if removed != local.len() * (size as usize - 2) {
            return None;
        }
        Some(kept.iter().map(|f| f.iter().map(|v| global[*v as usize]).collect()).collect())
    }

    /// Leaf ends of the axis, drawn back from their caps.
    pub(super) fn pull_leaves(&mut self, nodes: &[ControlNode]) {
        for (at, node) in nodes.iter().enumerate() {
            let mut near = self.axis.edges.iter().filter(|(a, b)| *a == at || *b == at);
            if let (NodeKind::Leaf, Some(&(a, b)), None) = (node.kind, near.next(), near.next()) {
                let other = self.axis.points[if a == at { b } else { a }];
                let leaf = self.axis.points[at];
                self.axis.points[at] = leaf + (other - leaf) * 0.2;
            }
        }
    }
}

/// Places for the middle of a branching node on the way from where it is to the mean of its sections.
fn on_way(start: &Point, sections: &[Point]) -> Vec<Point> {
    let mean = sections.iter().sum::<Point>() / sections.len() as f64;
    [0.5, 0.25, 0.75, 0.0, 1.0].map(|blend| start + (mean - start) * blend).to_vec()
}

/// And anywhere between these: limbs that all lead to one side have none on the way.
fn between(start: &Point, sections: &[Point]) -> Vec<Point> {
    let among: Vec<Point> = sections.iter().chain([start]).copied().collect();
    let parts = if among.len() <= MANY { PARTS } else { PARTS / 2 };
    let place = |share: &Vec<usize>| -> Point {
        share.iter().zip(&among).map(|(k, p)| p * (*k as f64 / parts as f64)).sum()
    };
    let mut found: Vec<Point> = shares(among.len(), parts).iter().map(place).collect();
    if among.iter().sum::<Point>().x.abs() < PLANE && start.x.abs() < PLANE {
        found.retain(|p| p.x.abs() < PLANE);
    }
    found
}

/// All ways to share so many parts among `n`.
fn shares(n: usize, parts: usize) -> Vec<Vec<usize>> {
    if n <= 1 {
        return vec![vec![parts; n]];
    }
    let with =
        |own: usize| shares(n - 1, parts - own).into_iter().map(move |rest| [vec![own], rest].concat());
    (0..=parts).flat_map(with).collect()
}

/// Puts the edge `a` `b` into a triangulation of the sphere by flips. `None` when it can't be.
fn insert_edge(points: &[Point], faces: &mut [[u32; 3]], a: u32, b: u32) -> Option<()> {
    let origin = Point::zeros();
    let at = |v: u32| &points[v as usize];
    let crosses = |p: u32, q: u32, u: u32, v: u32| {
        let s = side(&origin, at(p), at(q), at(u)) * side(&origin, at(p), at(q), at(v));
        let t = side(&origin, at(u), at(v), at(p)) * side(&origin, at(u), at(v), at(q));
        s < 0 && t < 0 && (at(p) + at(q)).dot(&(at(u) + at(v))) > 0.0
    };
    for round in 0..200_usize {
        if faces.iter().any(|f| f.contains(&a) && f.contains(&b)) {
            return Some(());
        }
        let mut flippable = Vec::new();
        for (i, f) in faces.iter().enumerate() {
            for k in 0..3 {
                let (u, v, w) = (f[k], f[(k + 1) % 3], f[(k + 2) % 3]);
                if u > v || [u, v].contains(&a) || [u, v].contains(&b) || !crosses(a, b, u, v) {
                    continue;
                }
                let other = faces.iter().enumerate().find_map(|(j, g)| {
                    (0..3).find(|m| g[*m] == v && g[(m + 1) % 3] == u).map(|m| (j, g[(m + 2) % 3]))
                });
                let (j, x) = other?;
                if crosses(w, x, u, v) {
                    flippable.push((i, j, [u, v, w, x]));
                }
            }
        }
        if flippable.is_empty() {
            return None;
        }
        let (i, j, [u, v, w, x]) = flippable[round % flippable.len()];
        faces[i] = [w, u, x];
        faces[j] = [x, v, w];
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn quad(center: Point, direction: Point, width: f64) -> Section {
        let (u, v) = super::super::sections::frame(&direction);
        let corners: Vec<Point> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .iter()
            .map(|(s, t)| center + u * (s * width) + v * (t * width))
            .collect();
        Section { ring: corners.clone(), corners, center }
    }

    #[test]
    fn six_sections_around_a_node_close_with_every_side_in_two_faces() {
        let ways = [Point::x(), -Point::x(), Point::y(), -Point::y(), Point::z(), -Point::z()];
        let found: Vec<Section> = ways.iter().map(|d| quad(*d, *d, 0.4)).collect();
        let mut built = Scaffold {
            corners: found.iter().flat_map(|s| s.corners.clone()).collect(),
            start: found.iter().flat_map(|s| s.corners.clone()).collect(),
            owner: (0..24).map(|v| v / 4).collect(),
            centers: ways.to_vec(),
            polygons: Vec::new(),
            axis: Axis::default(),
        };
        let members: Vec<(usize, bool)> = (0..6).map(|n| (n, true)).collect();
        let ring = |n: usize| (0..4).map(|k| (4 * n + k) as u32).collect::<Vec<u32>>();
        assert!(built.branch(&Point::zeros(), &members, &ring).is_some());
        for n in 0..6 {
            built.polygons.push(ring(n));
        }
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for t in built.triangles() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|sum| *sum == 0));
        assert_eq!(built.triangles().len(), 2 * 24 - 4);
    }

    #[test]
    fn limbs_that_lead_to_one_side_are_joined_about_a_place_between_them() {
        // Two that lean toward each other: the mean of all is in front of them, not behind.
        let at = |(x, y, u, v): (f64, f64, f64, f64)| {
            quad(Point::new(x, y, 0.0), Point::new(u, v, 0.0).normalize(), 0.1)
        };
        let found = [(-1.0, 0.3, 0.12, 1.0), (0.0, 0.0, 0.0, -1.0), (1.0, 0.3, -0.12, 1.0)].map(at).to_vec();
        let mut built = Scaffold {
            corners: found.iter().flat_map(|s| s.corners.clone()).collect(),
            start: found.iter().flat_map(|s| s.corners.clone()).collect(),
            owner: (0..12).map(|v| v / 4).collect(),
            centers: found.iter().map(|s| s.center).collect(),
            polygons: Vec::new(),
            axis: Axis::default(),
        };
        let members: Vec<(usize, bool)> = (0..3).map(|n| (n, true)).collect();
        let ring = |n: usize| (0..4).map(|k| (4 * n + k) as u32).collect::<Vec<u32>>();
        let center = built.branch(&Point::new(0.0, 0.6, 0.0), &members, &ring).expect("a place");
        assert!(center.x == 0.0 && center.y > 0.0 && center.y < 0.18, "{center}");
        assert_eq!(built.polygons.len(), 2 * 12 - 4 - 3 * 2);
        assert_eq!(shares(3, 2).len(), 6);
    }
}
