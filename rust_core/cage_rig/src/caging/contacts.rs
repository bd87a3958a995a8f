//! Which features of a cage face which of the skin, or of the cage itself, across a small gap.
//!
//! Every vertex and edge belongs to one of its triangles, so that no gap is listed twice. The list is
//! sorted by width: whoever knows how far things have moved since looks at its beginning only.

use crate::geometry::bvh::Bvh;
use crate::geometry::collision::{across, weights, width, Gap};
use crate::points::Point;
use rayon::prelude::*;
use std::collections::HashSet;

/// A gap between four points; indices from the number of cage vertices on are the obstacle's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact {
    pub(crate) gap: Gap,
    pub(crate) at: [u32; 4],
    /// When it was found.
    pub(crate) width: f64,
}

/// Those of a sorted list that were found narrower than `limit`.
pub(crate) fn narrower(sorted: &[Contact], limit: f64) -> &[Contact] {
    &sorted[..sorted.partition_point(|c| c.width < limit)]
}

/// A mesh whose features are told apart, with boxes around its triangles.
pub(crate) struct Body {
    pub(crate) tree: Bvh,
    /// Which corners and which sides (k to k + 1) a triangle owns.
    owns: Vec<([bool; 3], [bool; 3])>,
    /// Triangles that never move: gaps between two of them are of no interest.
    still: Vec<bool>,
    /// Sides that cross: the two diagonals of a quad.
    crossed: HashSet<[u32; 4]>,
}

impl Body {
    pub(crate) fn new(points: &[Point], triangles: &[[u32; 3]]) -> Self {
        let (mut corners, mut sides) = (HashSet::new(), HashSet::new());
        let owns = triangles
            .iter()
            .map(|t| {
                let own = [0, 1, 2].map(|k| corners.insert(t[k]));
                (own, [0, 1, 2].map(|k| sides.insert((t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])))))
            })
            .collect();
        Self {
            tree: Bvh::new(points, triangles),
            owns,
            still: vec![false; triangles.len()],
            crossed: HashSet::new(),
        }
    }

    /// Triangles, and quads split both ways.
    pub(crate) fn with_quads(points: &[Point], triangles: &[[u32; 3]], quads: &[[u32; 4]]) -> Self {
        let mut found = Self::new(points, &[triangles, &split_otherwise(quads)[..]].concat());
        let crossing = |[a, b, c, d]: &[u32; 4]| {
            let (p, q) = ([*a.min(c), *a.max(c)], [*b.min(d), *b.max(d)]);
            let (p, q) = (p.min(q), p.max(q));
            [p[0], p[1], q[0], q[1]]
        };
        found.crossed = quads.iter().map(crossing).collect();
        found
    }

    /// Triangles with no corner that moves are still from now on.
    pub(crate) fn hold(&mut self, moves: impl Fn(u32) -> bool) {
        self.still = self.tree.triangles().iter().map(|t| !t.iter().any(|v| moves(*v))).collect();
    }
}

/// Quads that are fans of their first corners, split by the other diagonal.
pub(crate) fn split_otherwise(quads: &[[u32; 4]]) -> Vec<[u32; 3]> {
    quads.iter().flat_map(|[a, b, c, d]| [[*b, *c, *d], [*b, *d, *a]]).collect()
}

/// The points of both bodies, as contacts count them.
pub(crate) struct Points<'a> {
    pub(crate) cage: &'a [Point],
    pub(crate) obstacle: &'a [Point],
}

impl Points<'_> {
    pub(crate) fn of(&self, contact: &Contact) -> [Point; 4] {
        let n = self.cage.len();
        contact
            .at
            .map(|v| if (v as usize) < n { self.cage[v as usize] } else { self.obstacle[v as usize - n] })
    }

    pub(crate) fn width(&self, contact: &Contact) -> f64 {
        width(contact.gap, &self.of(contact))
    }

    /// Weights, unit vector across, and width.
    pub(crate) fn gap(&self, contact: &Contact) -> ([f64; 4], Point, f64) {
        let x = self.of(contact);
        let w = weights(contact.gap, &x);
        let vector = across(&w, &x);
        let width = vector.norm();
        (w, vector / width.max(1e-300), width)
    }
}

/// All gaps narrower than `reach` that a moving part of the cage has a part in, the narrowest first. Trees must be
/// fitted to `points`.
pub(crate) fn contacts(cage: &Body, obstacle: &Body, points: &Points, reach: f64) -> Vec<Contact> {
    let faces = cage.tree.triangles();
    let near = |at: usize| {
        let mut found = Vec::new();
        if !cage.still[at] {
            with_obstacle(at, cage, obstacle, points, reach, &mut found);
        }
        with_itself(at, cage, points, reach, &mut found);
        found
    };
    let mut found: Vec<Contact> = (0..faces.len()).into_par_iter().flat_map_iter(near).collect();
    found.par_sort_by(|a, b| a.width.total_cmp(&b.width));
    found
}

fn push(found: &mut Vec<Contact>, gap: Gap, at: [u32; 4], points: &Points, reach: f64) {
    let mut contact = Contact { gap, at, width: 0.0 };
    contact.width = points.width(&contact);
    if contact.width < reach {
        found.push(contact);
    }
}

/// Whether the boxes of two groups of points are nearer than `reach`.
fn close(a: &[Point], b: &[Point], reach: f64) -> bool {
    let bounds = |x: &[Point]| x.iter().skip(1).fold((x[0], x[0]), |(l, h), p| (l.inf(p), h.sup(p)));
    let ((l, h), (m, i)) = (bounds(a), bounds(b));
    (m - h).sup(&(l - i)).sup(&Point::zeros()).norm_squared() < reach * reach
}

fn with_obstacle(
    at: usize,
    cage: &Body,
    obstacle: &Body,
    points: &Points,
    reach: f64,
    found: &mut Vec<Contact>,
) {
    let n = points.cage.len() as u32;
    let a = cage.tree.triangles()[at];
    let (own_corners, own_sides) = cage.owns[at];
    let x = a.map(|v| points.cage[v as usize]);
    let sides_of_face = [0, 1, 2].map(|k| [x[k], x[(k + 1) % 3]]);
    obstacle.tree.near_triangle([&x[0], &x[1], &x[2]], reach, |t| {
        let b = obstacle.tree.triangles()[t as usize];
        let y = b.map(|v| points.obstacle[v as usize]);
        if !close(&x, &y, reach) {
            return;
        }
        let b = b.map(|v| v + n);
        let (corners, sides) = obstacle.owns[t as usize];
        let mut add = |gap, at| push(found, gap, at, points, reach);
        for k in 0..3 {
            if corners[k] {
                add(Gap::PointTriangle, [b[k], a[0], a[1], a[2]]);
            }
            if own_corners[k] {
                add(Gap::PointTriangle, [a[k], b[0], b[1], b[2]]);
            }
            if !own_sides[k] || !close(&sides_of_face[k], &y, reach) {
                continue;
            }
            for m in 0..3 {
                if sides[m] {
                    add(Gap::EdgeEdge, [a[k], a[(k + 1) % 3], b[m], b[(m + 1) % 3]]);
                }
            }
        }
    });
}

fn with_itself(at: usize, cage: &Body, points: &Points, reach: f64, found: &mut Vec<Contact>) {
    let a = cage.tree.triangles()[at];
    let own_sides = cage.owns[at].1;
    cage.tree.near_triangle(a.map(|v| &points.cage[v as usize]), reach, |t| {
        if cage.still[at] && cage.still[t as usize] {
            return;
        }
        let b = cage.tree.triangles()[t as usize];
        let (corners, sides) = cage.owns[t as usize];
        let mut add = |gap, at| push(found, gap, at, points, reach);
        for k in 0..3 {
            if corners[k] && !a.contains(&b[k]) {
                add(Gap::PointTriangle, [b[k], a[0], a[1], a[2]]);
            }
            for m in 0..3 {
                let (p, q) = ([a[k], a[(k + 1) % 3]], [b[m], b[(m + 1) % 3]]);
                let [low, high] = [p, q].map(|e| (e[0].min(e[1]), e[0].max(e[1])));
                let apart = !p.contains(&q[0]) && !p.contains(&q[1]);
                let apart = apart && !cage.crossed.contains(&[low.0, low.1, high.0, high.1]);
                if own_sides[k] && sides[m] && low < high && apart {
                    add(Gap::EdgeEdge, [p[0], p[1], q[0], q[1]]);
                }
            }
        }
    });
}
