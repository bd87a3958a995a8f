//! A curve skeleton for a skin that has none: the graph of the parts of level sets.
//!
//! A distance along the surface is cut into bands; each connected part of a band is a ring around a limb,
//! and becomes a node in its middle; rings that touch are linked (level set diagrams after Lazarus and
//! Verroust, 1999: a Reeb graph, which has a loop for each handle and a leaf for each limb). The mean
//! distance from all of the surface (Hilaga et al., 2001) grows from the middle of the body to the end of
//! every limb, and cuts each straight across; around a ring of rings it says nothing, and the
//! distance from a far end is taken. Straight runs are thinned out. `n log n` in the triangles.

use super::obstacle::{Mesh, Obstacles};
use super::skin::Skin;
use super::surface_distance::{along_edges, far_ends, mean_distance, neighbours, smooth};
use super::symmetry;
use crate::error::CagingError;
use crate::mesh::Polygons;
use crate::points::Point;
use std::collections::{BTreeSet, HashMap};

/// Bands from one end to the other, fewer on a coarse mesh.
const BANDS: f64 = 48.0;
/// Edges are no longer, relative to the size.
const EDGE: f64 = 0.015;
/// The mean distance has failed where its rings are less round than this part of the others.
const FAILS: f64 = 0.7;
/// A tip is near a ball that would reach it with this times its radius.
const NEAR_BALL: f64 = 1.2;
/// What is nearer to the skin than this, relative to the size, is at the surface.
const SHALLOW: f64 = 4e-3;
/// A node is left out where it is nearer than this to the straight line, in radii.
const STRAIGHT: f64 = 0.25;

/// A graph of straight lines.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ExtractedSkeleton {
    /// `#N by 3`, the skin's space.
    pub nodes: Vec<Point>,
    /// Pairs of nodes.
    pub edges: Vec<[i64; 2]>,
}

/// The curve skeleton of a closed skin (`vertices` `#V by 3`).
pub fn extract_skeleton(vertices: &[Point], faces: &Polygons) -> Result<ExtractedSkeleton, CagingError> {
    let mut skin = Skin::new(vertices, faces)?;
    skin.symmetric = symmetry::is_symmetric(&skin);
    let mut mesh = Obstacles::of(&skin).growth.mesh;
    mesh.refine(EDGE);
    let Mesh { points, triangles } = mesh;
    let around = neighbours(points.len(), &triangles);
    let ends = far_ends(&points, &around, skin.symmetric);
    let cut = |mut distance: Vec<f64>| {
        smooth(&mut distance, &around);
        rings(&points, &around, &distance, skin.symmetric)
    };
    let mean = cut(mean_distance(&points, &around, &ends, skin.symmetric));
    let from_end = cut(along_edges(&points, &around, &ends));
    let fails = roundness(&skin, &points, &mean) < FAILS * roundness(&skin, &points, &from_end);
    let Rings { graph, middle, .. } = if fails { from_end } else { mean };
    let graph = thin(&skin, if skin.symmetric { mirrored(&graph, &middle) } else { graph });
    if graph.edges.is_empty() {
        return Err(CagingError::SkeletonEmpty);
    }
    Ok(ExtractedSkeleton {
        nodes: graph.points.iter().map(|p| skin.space.leave(p)).collect(),
        edges: graph.edges.iter().map(|(a, b)| [*a as i64, *b as i64]).collect(),
    })
}

/// A graph while it is thinned out.
#[derive(Debug, Default)]
struct Graph {
    points: Vec<Point>,
    edges: BTreeSet<(usize, usize)>,
}

impl Graph {
    fn link(&mut self, a: usize, b: usize) {
        if a != b {
            self.edges.insert((a.min(b), a.max(b)));
        }
    }

    fn around(&self) -> Vec<Vec<usize>> {
        let mut found = vec![Vec::new(); self.points.len()];
        for &(a, b) in &self.edges {
            found[a].push(b);
            found[b].push(a);
        }
        found
    }
}

/// The middles of the connected parts of bands, linked where they touch.
struct Rings {
    graph: Graph,
    /// Whether each reaches the plane x = 0.
    middle: Vec<bool>,
    /// The ring of each vertex.
    at: Vec<usize>,
}

/// How round rings are about their middles, from 0 to 1 over all of the surface.
fn roundness(skin: &Skin, points: &[Point], rings: &Rings) -> f64 {
    let middles = &rings.graph.points;
    let depth: Vec<f64> = middles.iter().map(|p| skin.depth(p).max(0.0)).collect();
    let of = |(v, ring): (usize, &usize)| (depth[*ring] / (points[v] - middles[*ring]).norm()).min(1.0);
    let found: Vec<f64> = rings.at.iter().enumerate().filter(|(_, r)| **r != usize::MAX).map(of).collect();
    found.iter().sum::<f64>() / found.len().max(1) as f64
}

/// Rings of `distance`. `half`: of what is on the greater side of the plane, where parts that are one in
/// the whole and reach the plane are one.
fn rings(points: &[Point], around: &[Vec<u32>], distance: &[f64], half: bool) -> Rings {
    let far = distance.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max);
    // No edge may reach past the next band, or a ring falls apart.
    let reach =
        |v: usize| around[v].iter().map(|w| (distance[v] - distance[*w as usize]).abs()).fold(0.0, f64::max);
    let finite = (0..points.len()).filter(|v| distance[*v].is_finite());
    let width = finite.map(reach).fold(far / BANDS, f64::max).max(1e-300);
    let band = |v: usize| (distance[v] / width).floor() as usize;
    let in_part = |v: usize| distance[v].is_finite() && !around[v].is_empty();
    let beyond = |v: usize| half && points[v].x < 0.0;
    let kept = |v: usize| in_part(v) && !beyond(v);
    let alike = |v: usize, w: usize| band(v) == band(w);
    let whole = parts(around, in_part, alike);
    let wholes = group(&whole);
    let (mut at, mut of_whole) = (vec![usize::MAX; points.len()], HashMap::new());
    let (mut graph, mut middle) = (Graph::default(), Vec::new());
    let center = |ring: &[usize]| ring.iter().map(|v| points[*v]).sum::<Point>() / ring.len() as f64;
    for part in group(&parts(around, kept, alike)) {
        let reaches = part.iter().any(|v| around[*v].iter().any(|w| beyond(*w as usize)));
        let (new, ring) = (graph.points.len(), whole[part[0]]);
        let node = if reaches { *of_whole.entry(ring).or_insert(new) } else { new };
        if node == new {
            graph.points.push(center(if reaches { &wholes[ring] } else { &part }));
            middle.push(reaches);
        }
        part.iter().for_each(|v| at[*v] = node);
    }
    for (v, near) in around.iter().enumerate().filter(|(v, _)| kept(*v)) {
        for w in near.iter().map(|w| *w as usize).filter(|w| kept(*w)) {
            graph.link(at[v], at[w]);
        }
    }
    Rings { graph, middle, at }
}

/// For each vertex that is `inside` the number of its part: what is connected and `alike`.
fn parts(
    around: &[Vec<u32>],
    inside: impl Fn(usize) -> bool,
    alike: impl Fn(usize, usize) -> bool,
) -> Vec<usize> {
    let mut part = vec![usize::MAX; around.len()];
    let mut count = 0;
    for start in 0..around.len() {
        if part[start] != usize::MAX || !inside(start) {
            continue;
        }
        part[start] = count;
        let mut stack = vec![start];
        while let Some(v) = stack.pop() {
            for w in around[v].iter().map(|w| *w as usize) {
                if part[w] == usize::MAX && inside(w) && alike(v, w) {
                    part[w] = count;
                    stack.push(w);
                }
            }
        }
        count += 1;
    }
    part
}

/// The vertices of each part.
fn group(part: &[usize]) -> Vec<Vec<usize>> {
    let count = part.iter().filter(|p| **p != usize::MAX).max().map_or(0, |p| p + 1);
    let mut found = vec![Vec::new(); count];
    for (v, p) in part.iter().enumerate().filter(|(_, p)| **p != usize::MAX) {
        found[*p].push(v);
    }
    found
}

/// Half a graph and its mirror image, joined by what reaches the plane. Where the half is a tree, so is
/// the whole, unless the skin leaves the plane and comes back to it.
fn mirrored(half: &Graph, middle: &[bool]) -> Graph {
    let count = half.points.len();
    let mut both = Graph::default();
    let on_plane = |p: &Point| Point::new(0.0, p.y, p.z);
    both.points.extend(half.points.iter().zip(middle).map(|(p, m)| if *m { on_plane(p) } else { *p }));
    both.points.extend(half.points.iter().map(symmetry::image));
    let other = |i: usize| if middle[i] { i } else { i + count };
    for &(a, b) in &half.edges {
        both.link(a, b);
        both.link(other(a), other(b));
    }
    both
}

/// Cuts ends back while they are at the surface, or the inscribed ball of the next node reaches near
/// their tip.
fn trim(skin: &Skin, graph: &mut Graph) {
    let mut tips = graph.points.clone();
    loop {
        let around = graph.around();
        let shallow = |at: usize| skin.depth(&graph.points[at]) < SHALLOW;
        let reached = |tip: usize, at: usize| {
            (tips[tip] - graph.points[at]).norm() < NEAR_BALL * skin.depth(&graph.points[at])
        };
        let end = |i: &usize| around[*i].len() == 1 && (shallow(*i) || reached(*i, around[*i][0]));
        let Some(i) = (0..around.len()).find(end).filter(|_| graph.edges.len() > 2) else { return };
        let next = around[i][0];
        graph.edges.remove(&(i.min(next), i.max(next)));
        if around[next].len() == 2 {
            tips[next] = tips[i];
        }
    }
}

/// Smooths limbs and leaves out what lies on a straight line between its neighbours.
fn thin(skin: &Skin, mut graph: Graph) -> Graph {
    trim(skin, &mut graph);
    let around = graph.around();
    for _ in 0..2 {
        let old = graph.points.clone();
        for (i, near) in around.iter().enumerate() {
            if let [a, b] = near[..] {
                graph.points[i] = old[i] * 0.5 + (old[a] + old[b]) * 0.25;
            }
        }
    }
    loop {
        let around = graph.around();
        let straight = |i: &usize| {
            let [a, b] = around[*i][..] else { return false };
            let (p, q, x) = (graph.points[a], graph.points[b], graph.points[*i]);
            let u = q - p;
            let t = ((x - p).dot(&u) / u.norm_squared().max(1e-300)).clamp(0.0, 1.0);
            let radius = skin.depth(&x);
            let bends = (p + u * t - x).norm() > STRAIGHT * radius;
            // Two ways between the same nodes are a loop and stay one.
            !bends && u.norm() < 8.0 * radius.abs() && !graph.edges.contains(&(a.min(b), a.max(b)))
        };
        // Every other one at most, so that a bend is not used up step by step.
        let mut taken = vec![false; graph.points.len()];
        let mut out = Vec::new();
        for i in 0..graph.points.len() {
            // With its mirror image, if it has one.
            let image = symmetry::image(&graph.points[i]);
            let both =
                (0..graph.points.len()).filter(|k| *k == i || graph.points[*k] == image && straight(k));
            let both: Vec<usize> = both.collect();
            let free = |k: &usize| !taken[*k] && around[*k].iter().all(|n| !taken[*n] && !both.contains(n));
            if straight(&i) && both.iter().all(free) {
                both.iter().for_each(|k| taken[*k] = true);
                out.extend(both);
            }
        }
        if out.is_empty() {
            return compact(graph);
        }
        for i in out {
            let [a, b] = around[i][..] else { continue };
            graph.edges.remove(&(a.min(i), a.max(i)));
            graph.edges.remove(&(b.min(i), b.max(i)));
            graph.link(a, b);
        }
    }
}

/// Without nodes that nothing is linked to.
fn compact(graph: Graph) -> Graph {
    let around = graph.around();
    let kept: Vec<usize> = (0..around.len()).filter(|i| !around[*i].is_empty()).collect();
    let place = |i: usize| kept.binary_search(&i).unwrap_or(0);
    Graph {
        points: kept.iter().map(|i| graph.points[*i]).collect(),
        edges: graph.edges.iter().map(|(a, b)| (place(*a), place(*b))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::shapes::square_tube;

    #[test]
    fn a_bar_has_a_straight_line_through_its_middle() {
        let rings: Vec<(f64, f64)> = (0..31).map(|i| (f64::from(i) / 3.0, 0.6)).collect();
        let (vertices, faces) = square_tube(&rings);
        let found = extract_skeleton(&vertices, &faces).expect("a line");
        // Its ends may lead into corners.
        let inner = |p: &&Point| (1.0..9.0).contains(&p.x);
        assert!(found.nodes.iter().filter(inner).count() >= 2);
        assert!(found.nodes.iter().filter(inner).all(|p| p.yz().norm() < 0.1), "off the middle");
        for p in &found.nodes {
            let image = Point::new(10.0 - p.x, p.y, p.z);
            assert!(found.nodes.iter().any(|q| (q - image).norm() < 1e-9), "not symmetric at {p}");
        }
        let length: f64 = found
            .edges
            .iter()
            .map(|[a, b]| (found.nodes[*a as usize] - found.nodes[*b as usize]).norm())
            .sum();
        assert!((8.0..10.5).contains(&length), "{length}");
        assert_eq!(found.edges.len() + 1, found.nodes.len());
    }

    #[test]
    fn a_ring_of_rings_keeps_its_loop() {
        let (vertices, faces) = crate::fixtures::shapes::torus(60, 12, 1.0, 0.25);
        let found = extract_skeleton(&vertices, &faces).expect("a loop");
        assert_eq!(found.edges.len(), found.nodes.len(), "one loop");
        for p in &found.nodes {
            assert!((p.xy().norm() - 1.0).abs() < 0.2 && p.z.abs() < 0.1, "{p}");
        }
    }
}
