//! The curve skeleton: arcs between leaves and branching nodes, inside the skin.
//!
//! [CLM*19] §3 takes a curve skeleton as given; here any graph of nodes and edges is made into one.
//! Nodes outside the skin are clipped toward their inside end and recentred (uphill in the distance
//! to the skin); what stays outside is dropped, and the rest pruned. Linear in the nodes but for that.

use super::pruning::{drop_crown, merge, prune};
use super::skin::Skin;
use super::symmetry::image;
use super::tips::{lead_on, unfold};
use crate::error::CagingError;
use crate::points::{first_unusable, Point};
use rayon::prelude::*;

/// Depth below which a node counts as outside, relative to the size.
const MARGIN: f64 = 2e-3;

/// A curve skeleton in unit space.
#[derive(Debug, Clone, Default)]
pub(crate) struct CurveSkeleton {
    pub(crate) junctions: Vec<Junction>,
    pub(crate) arcs: Vec<Arc>,
    /// Nodes of the input that take no part.
    pub(crate) dropped: Vec<usize>,
}

/// Where arcs end.
#[derive(Debug, Clone)]
pub(crate) struct Junction {
    pub(crate) point: Point,
    pub(crate) radius: f64,
    pub(crate) node: usize,
    /// Arcs that end here, an arc twice when it is a loop.
    pub(crate) degree: usize,
}

/// A polyline between two junctions.
#[derive(Debug, Clone)]
pub(crate) struct Arc {
    pub(crate) ends: [usize; 2],
    pub(crate) path: Vec<Point>,
    /// Distance from the first end, of each point of the path.
    pub(crate) along: Vec<f64>,
    /// Depth of each point of the path.
    pub(crate) radii: Vec<f64>,
    /// The input's node at each point of the path, where it is one.
    pub(crate) nodes: Vec<Option<usize>>,
}

impl Arc {
    pub(crate) fn length(&self) -> f64 {
        self.along.last().copied().unwrap_or(0.0)
    }

    fn locate(&self, s: f64) -> (usize, f64) {
        let last = self.path.len().saturating_sub(2);
        let k = self.along.partition_point(|a| *a <= s).saturating_sub(1).min(last);
        let span = self.along[k + 1] - self.along[k];
        (k, if span > 0.0 { ((s - self.along[k]) / span).clamp(0.0, 1.0) } else { 0.0 })
    }

    pub(crate) fn at(&self, s: f64) -> Point {
        let (k, t) = self.locate(s);
        self.path[k] + (self.path[k + 1] - self.path[k]) * t
    }

    pub(crate) fn radius_at(&self, s: f64) -> f64 {
        let (k, t) = self.locate(s);
        self.radii[k] + (self.radii[k + 1] - self.radii[k]) * t
    }

    /// Direction at `s`, over a stretch of `width` to both sides.
    pub(crate) fn direction(&self, s: f64, width: f64) -> Point {
        let (a, b) = (self.at((s - width).max(0.0)), self.at((s + width).min(self.length())));
        (b - a).try_normalize(1e-12).unwrap_or_else(Point::x)
    }

    /// Adds points (with their depths) beyond one end.
    pub(super) fn append(&mut self, side: usize, beyond: &[(Point, f64)]) {
        if side == 0 {
            self.turn();
        }
        for (point, depth) in beyond {
            if let (Some(last), Some(s)) = (self.path.last(), self.along.last()) {
                self.along.push(s + (point - last).norm());
            }
            self.path.push(*point);
            self.radii.push(*depth);
            self.nodes.push(None);
        }
        if side == 0 {
            self.turn();
        }
    }

    /// The other way round.
    pub(super) fn turn(&mut self) {
        let length = self.length();
        self.ends.reverse();
        self.path.reverse();
        self.radii.reverse();
        self.nodes.reverse();
        self.along.reverse();
        self.along.iter_mut().for_each(|s| *s = length - *s);
    }

    /// Nearest point: (distance, s).
    pub(crate) fn nearest(&self, p: &Point) -> (f64, f64) {
        let mut best = (f64::INFINITY, 0.0);
        for k in 0..self.path.len() - 1 {
            let (a, u) = (self.path[k], self.path[k + 1] - self.path[k]);
            let t = ((p - a).dot(&u) / u.norm_squared().max(1e-300)).clamp(0.0, 1.0);
            let distance = (a + u * t - p).norm();
            if distance < best.0 {
                best = (distance, self.along[k] + t * (self.along[k + 1] - self.along[k]));
            }
        }
        best
    }
}

impl CurveSkeleton {
    /// The tip (a node of the input) of the leaf at a junction that sticks out the least, or of one
    /// at a neighbouring junction.
    pub(crate) fn least_leaf(&self, junction: usize) -> Option<usize> {
        let leaf = |at: usize| {
            let tips =
                self.arcs.iter().flat_map(|arc| [(arc.ends[0], arc.ends[1]), (arc.ends[1], arc.ends[0])]);
            let tips = tips.filter(|(base, tip)| *base == at && self.junctions[*tip].degree == 1);
            let reach = |tip: usize| (self.junctions[tip].point - self.junctions[at].point).norm();
            tips.map(|(_, tip)| (reach(tip), tip)).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let near = || {
            let ends = self.arcs.iter().map(|arc| arc.ends);
            let others = ends.flat_map(|[a, b]| [(a, b), (b, a)]).filter(|(a, _)| *a == junction);
            others.filter_map(|(_, b)| leaf(b)).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        leaf(junction).or_else(near).map(|(_, tip)| self.junctions[tip].node)
    }
}

/// The graph while it is being worked on.
pub(super) struct Graph {
    pub(super) points: Vec<Point>,
    /// The input's node of each.
    pub(super) node: Vec<usize>,
    pub(super) edges: Vec<(usize, usize)>,
    pub(super) dropped: Vec<usize>,
}

/// Cleans the graph of `nodes` (`#N by 3`, the user's space) and `edges` and cuts it into arcs. Leaves
/// thinner than `detail` (of the size) are left out, and those whose tip is one of the nodes `without`.
pub(crate) fn curve_skeleton(
    skin: &Skin,
    nodes: &[Point],
    edges: &[[i64; 2]],
    detail: f64,
    without: &[usize],
) -> Result<CurveSkeleton, CagingError> {
    let mut graph = read(skin, nodes, edges)?;
    clip(skin, &mut graph)?;
    keep_largest(&mut graph);
    unfold(skin, &mut graph);
    recentre(skin, &mut graph);
    loop {
        let mut skeleton = cut(skin, &graph);
        if skeleton.arcs.is_empty() {
            return Err(CagingError::SkeletonOutside);
        }
        let changed = prune(skin, &mut graph, &skeleton, (detail, without))
            || drop_crown(skin, &mut graph, &skeleton)
            || merge(&mut graph, &skeleton)
            || unfold(skin, &mut graph);
        if !changed {
            lead_on(skin, &mut skeleton);
            return Ok(skeleton);
        }
    }
}

fn read(skin: &Skin, nodes: &[Point], edges: &[[i64; 2]]) -> Result<Graph, CagingError> {
    if nodes.is_empty() || edges.is_empty() {
        return Err(CagingError::SkeletonEmpty);
    }
    if let Some(node) = first_unusable(nodes) {
        return Err(CagingError::NodeNotFinite { node });
    }
    for (edge, ends) in edges.iter().enumerate() {
        if let Some(&node) = ends.iter().find(|n| **n < 0 || **n >= nodes.len() as i64) {
            return Err(CagingError::BadEdge { edge, node, nodes: nodes.len() });
        }
    }
    let mut graph = Graph { points: Vec::new(), node: Vec::new(), edges: Vec::new(), dropped: Vec::new() };
    let mut place = Vec::with_capacity(nodes.len());
    for (node, p) in nodes.iter().enumerate() {
        let p = skin.space.enter(p);
        let same = graph.points.iter().position(|q| (q - p).norm() < 1e-4);
        place.push(same.unwrap_or(graph.points.len()));
        if same.is_none() {
            graph.points.push(p);
            graph.node.push(node);
        }
    }
    for [a, b] in edges {
        join(&mut graph.edges, place[*a as usize], place[*b as usize]);
    }
    Ok(graph)
}

pub(super) fn join(edges: &mut Vec<(usize, usize)>, a: usize, b: usize) {
    let edge = (a.min(b), a.max(b));
    if a != b && !edges.contains(&edge) {
        edges.push(edge);
    }
}

fn clip(skin: &Skin, graph: &mut Graph) -> Result<(), CagingError> {
    let mut depth: Vec<f64> = graph.points.par_iter().map(|p| skin.depth(p)).collect();
    // From the inside outward, so that a chain that leaves the skin is followed to its end.
    loop {
        let next = graph.edges.iter().find_map(|&(a, b)| match (depth[a] > MARGIN, depth[b] > MARGIN) {
            (true, false) if depth[b].is_finite() => Some((a, b)),
            (false, true) if depth[a].is_finite() => Some((b, a)),
            _ => None,
        });
        let Some((inside, outside)) = next else { break };
        let (p, q) = (graph.points[inside], graph.points[outside]);
        let found = (1..20).rev().map(|k| p + (q - p) * (f64::from(k) / 20.0)).find_map(|x| {
            let d = skin.depth(&x);
            (d > MARGIN).then_some((x, d))
        });
        match found {
            Some((x, d)) => (graph.points[outside], depth[outside]) = (x, d),
            None => depth[outside] = f64::NEG_INFINITY,
        }
    }
    if depth.iter().all(|d| *d <= MARGIN) {
        return Err(CagingError::SkeletonOutside);
    }
    graph.edges.retain(|(a, b)| depth[*a] > MARGIN && depth[*b] > MARGIN);
    graph.dropped.extend((0..depth.len()).filter(|i| depth[*i] <= MARGIN).map(|i| graph.node[i]));
    if graph.edges.is_empty() {
        return Err(CagingError::SkeletonOutside);
    }
    Ok(())
}

/// Keeps the connected part with the greatest length; nodes of the others are dropped by name.
fn keep_largest(graph: &mut Graph) {
    let mut part: Vec<usize> = (0..graph.points.len()).collect();
    let root = |part: &[usize], mut i: usize| {
        while part[i] != i {
            i = part[i];
        }
        i
    };
    for &(a, b) in &graph.edges {
        let (a, b) = (root(&part, a), root(&part, b));
        part[a.max(b)] = a.min(b);
    }
    let mut length = vec![0.0; part.len()];
    for &(a, b) in &graph.edges {
        length[root(&part, a)] += (graph.points[a] - graph.points[b]).norm();
    }
    let best = (0..part.len()).max_by(|a, b| length[*a].total_cmp(&length[*b]).then(b.cmp(a))).unwrap_or(0);
    let kept: Vec<bool> = (0..part.len()).map(|i| root(&part, i) == best).collect();
    graph.edges.retain(|(a, _)| kept[*a]);
    let lost = (0..kept.len()).filter(|i| !kept[*i] && !graph.dropped.contains(&graph.node[*i]));
    let lost: Vec<usize> = lost.map(|i| graph.node[i]).collect();
    graph.dropped.extend(lost);
}

/// Moves nodes uphill in depth, across their bones rather than along them.
fn recentre(skin: &Skin, graph: &mut Graph) {
    let degree = |i: usize| graph.edges.iter().filter(|(a, b)| *a == i || *b == i).count();
    let moved: Vec<Point> = (0..graph.points.len())
        .into_par_iter()
        .map(|i| {
            let start = graph.points[i];
            if degree(i) == 0 {
                return start;
            }
            let around = graph.edges.iter().filter_map(|&(a, b)| match (a == i, b == i) {
                (true, _) => Some(graph.points[b]),
                (_, true) => Some(graph.points[a]),
                _ => None,
            });
            let ways: Vec<Point> = around.filter_map(|q| (q - start).try_normalize(1e-12)).collect();
            let axis = match ways[..] {
                [u] => Some(u),
                [u, v] => (u - v).try_normalize(1e-6),
                _ => None,
            };
            climb(skin, start, axis)
        })
        .collect();
    graph.points = moved;
}

/// Uphill in depth from `start`, at right angles to `axis`, at most a radius far.
pub(crate) fn climb(skin: &Skin, start: Point, axis: Option<Point>) -> Point {
    if skin.is_image(&start) {
        return image(&climb(skin, image(&start), axis.as_ref().map(image)));
    }
    let mut at = start;
    let mut depth = skin.depth(&at);
    let limit = 1.5 * depth.max(4.0 * MARGIN);
    let stays_on_plane = skin.symmetric && start.x.abs() < 1e-9;
    for _ in 0..24 {
        let Some(near) = skin.tree.nearest(&skin.points, &at) else { return at };
        let mut up = at - near.point;
        if let Some(axis) = axis {
            up -= axis * axis.dot(&up);
        }
        if stays_on_plane {
            up.x = 0.0;
        }
        let Some(up) = up.try_normalize(1e-12) else { return at };
        let next = at + up * (0.12 * depth.max(MARGIN));
        let found = skin.depth(&next);
        if found <= depth * 1.002 || (next - start).norm() > limit {
            return at;
        }
        (at, depth) = (next, found);
    }
    at
}

/// Cuts the graph at every node that is not in the middle of a polyline.
fn cut(skin: &Skin, graph: &Graph) -> CurveSkeleton {
    let mut around = vec![Vec::new(); graph.points.len()];
    for (e, &(a, b)) in graph.edges.iter().enumerate() {
        around[a].push((b, e));
        around[b].push((a, e));
    }
    let mut skeleton = CurveSkeleton { dropped: graph.dropped.clone(), ..CurveSkeleton::default() };
    let mut junction = vec![usize::MAX; graph.points.len()];
    let mut used = vec![false; graph.edges.len()];
    let ends = (0..around.len()).filter(|i| !around[*i].is_empty() && around[*i].len() != 2);
    // After the ends: any node of what is left, a closed loop.
    for start in ends.chain(0..around.len()) {
        let whole_loop = around[start].len() == 2;
        for &(next, edge) in &around[start] {
            if used[edge] || (whole_loop && around[start].iter().all(|(_, e)| used[*e])) {
                continue;
            }
            let mut walk = vec![start];
            let (mut at, mut by) = (next, edge);
            loop {
                used[by] = true;
                walk.push(at);
                if around[at].len() != 2 || at == start {
                    break;
                }
                let Some(&(on, e)) = around[at].iter().find(|(_, e)| *e != by) else { break };
                (at, by) = (on, e);
            }
            let ends = [start, at].map(|i| {
                if junction[i] == usize::MAX {
                    junction[i] = skeleton.junctions.len();
                    let (point, node) = (graph.points[i], graph.node[i]);
                    skeleton.junctions.push(Junction { point, radius: skin.depth(&point), node, degree: 0 });
                }
                skeleton.junctions[junction[i]].degree += 1;
                junction[i]
            });
            skeleton.arcs.push(arc(skin, graph, ends, &walk));
        }
    }
    skeleton
}

fn arc(skin: &Skin, graph: &Graph, ends: [usize; 2], walk: &[usize]) -> Arc {
    let length: f64 = walk.windows(2).map(|w| (graph.points[w[0]] - graph.points[w[1]]).norm()).sum();
    let spacing = (length / 24.0).max(4e-3);
    let (mut path, mut nodes) = (vec![graph.points[walk[0]]], vec![Some(graph.node[walk[0]])]);
    for w in walk.windows(2) {
        let (a, b) = (graph.points[w[0]], graph.points[w[1]]);
        let pieces = ((b - a).norm() / spacing).ceil().max(1.0) as usize;
        for k in 1..=pieces {
            path.push(a + (b - a) * (k as f64 / pieces as f64));
            nodes.push((k == pieces).then_some(graph.node[w[1]]));
        }
    }
    let mut along = vec![0.0];
    for w in path.windows(2) {
        along.push(along[along.len() - 1] + (w[1] - w[0]).norm());
    }
    let radii = path.par_iter().map(|p| skin.depth(p).max(MARGIN)).collect();
    Arc { ends, path, along, radii, nodes }
}
