//! A start without any crossing: the skin drawn into a thin thread along the cage's axis.
//!
//! Every skin vertex gets a place on the axis graph: vertices at the ring of a section that of its
//! control node, the others by averaging over neighbours with midpoints measured *along the graph* (a
//! harmonic map into a graph; no chord across a concavity, loops and branchings included). Edges
//! whose ends lie far apart on the graph are split, then the surroundings of every node of the
//! graph drawn into it: after that each triangle lies along one straight line, inside the cage's tube
//! around it. About `500 · #vertices` table look-ups.

use super::axis_samples::Samples;
use super::obstacle::Mesh;
use super::sections::Section;
use super::tubes::Scaffold;
use super::verify;
use crate::geometry::bvh::Bvh;
use crate::points::Point;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Sweeps of random averaging with the rings held.
const SWEEPS: usize = 300;
/// Sweeps of descent after the rings are let go.
const FREE_SWEEPS: usize = 50;
/// Rounds of splitting.
const SPLITS: usize = 12;
/// Edges end shorter than this part of the lines of the graph that they are on.
const SHORT: f64 = 0.25;
/// Distances of the contracted skin from the axis: of those at rest, and at most of the cage's rings.
pub(crate) const THREADS: [(f64, f64); 3] = [(0.03, 0.25), (0.01, 0.05), (0.002, 0.01)];
/// The same in a cage that is as large as it will be.
pub(crate) const IN_PLACE: [(f64, f64); 8] = [
    (0.95, f64::INFINITY),
    (0.85, f64::INFINITY),
    (0.7, f64::INFINITY),
    (0.5, f64::INFINITY),
    (0.3, 1.0),
    (0.1, 0.5),
    (0.03, 0.25),
    (0.01, 0.05),
];

/// Where inflation starts. Unit space.
pub(crate) struct Start {
    pub(crate) cage: Vec<Point>,
    /// The obstacle at rest, some of its edges split.
    pub(crate) rest: Mesh,
    /// Its points contracted, inside the cage.
    pub(crate) obstacle: Vec<Point>,
}

/// Contracts `obstacle` into the start of `scaffold`; else a cage vertex at the fault.
///
/// `threads`: how far from the axis it may be, the widest first. `others`: triangles that quads of the cage may
/// also be split into.
pub(crate) fn start(
    scaffold: &Scaffold,
    sections: &[Section],
    obstacle: &Mesh,
    (threads, others): (&[(f64, f64)], &[[u32; 3]]),
) -> Result<Start, usize> {
    let faces = scaffold.triangles();
    let cage = scaffold.start.clone();
    if let Some(vertex) = verify::first_self_crossing(&cage, &faces) {
        return Err(vertex as usize);
    }
    let (tree, folded) = (Bvh::new(&cage, &faces), Bvh::new(&cage, others));
    let mut map = Map::new(scaffold, sections, obstacle.clone());
    map.split();
    map.draw_in();
    let places: Vec<Point> = map.at.iter().map(|s| map.graph.points[*s as usize]).collect();
    let mut fault = 0;
    for &(part, of_ring) in threads {
        let thread: Vec<Point> = (0..places.len())
            .map(|v| {
                let out = map.mesh.points[v] - places[v];
                let limit = of_ring * map.graph.width[map.at[v] as usize] / out.norm().max(1e-300);
                places[v] + out * part.min(limit)
            })
            .collect();
        match verify::first_outside(&tree, &cage, &thread, &map.mesh.triangles) {
            None if verify::crossing(&folded, &cage, &thread, &map.mesh.triangles).is_empty() => {
                return Ok(Start { cage, rest: map.mesh, obstacle: thread });
            }
            None => {}
            Some(vertex) => fault = vertex as usize,
        }
    }
    Err(fault)
}

/// A map of the obstacle's vertices into the axis graph.
struct Map {
    graph: Samples,
    mesh: Mesh,
    neighbours: Vec<Vec<u32>>,
    at: Vec<u32>,
}

impl Map {
    fn new(scaffold: &Scaffold, sections: &[Section], mesh: Mesh) -> Self {
        let tree = Bvh::new(&mesh.points, &mesh.triangles);
        let mut fixed = vec![u32::MAX; mesh.points.len()];
        for (node, section) in sections.iter().enumerate() {
            for p in &section.ring {
                let Some(near) = tree.nearest(&mesh.points, p) else { continue };
                let distance = |v: &u32| (mesh.points[*v as usize] - p).norm();
                let corners = mesh.triangles[near.triangle];
                if let Some(v) = corners.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) {
                    fixed[*v as usize] = node as u32;
                }
            }
        }
        let graph = Samples::new(scaffold);
        let neighbours = neighbours(mesh.points.len(), &mesh.triangles);
        let at = spread(&graph, &mesh.points, &neighbours, &fixed);
        let mut map = Self { graph, mesh, neighbours, at };
        map.average(&fixed);
        map.descend();
        map
    }

    /// Moves vertices halfway to a random neighbour, along the graph.
    fn average(&mut self, fixed: &[u32]) {
        let mut random = 0x2545_f491_4f6c_dd1d_u64;
        let loose = |v: &usize| fixed[*v] == u32::MAX && !self.neighbours[*v].is_empty();
        let loose: Vec<usize> = (0..fixed.len()).filter(loose).collect();
        for _ in 0..SWEEPS {
            for &v in &loose {
                random ^= random << 13;
                random ^= random >> 7;
                random ^= random << 17;
                let around = &self.neighbours[v];
                let other = around[(random >> 33) as usize % around.len()];
                self.at[v] = self.graph.middle(self.at[v], self.at[other as usize]);
            }
        }
    }

    /// Moves every vertex where its squared distances to its neighbours sum to less: no noise is left,
    /// and no edge between two rings jumps past their branching.
    fn descend(&mut self) {
        for _ in 0..FREE_SWEEPS {
            for (v, around) in self.neighbours.iter().enumerate().filter(|(_, near)| !near.is_empty()) {
                let cost = |s: u32| -> f64 {
                    around.iter().map(|w| self.graph.distance(s, self.at[*w as usize]).powi(2)).sum()
                };
                let here = self.at[v];
                let mut best = (cost(here) * (1.0 - 1e-9), here);
                for &(next, _) in &self.graph.links[here as usize] {
                    let found = cost(next as u32);
                    if found < best.0 {
                        best = (found, next as u32);
                    }
                }
                self.at[v] = best.1;
            }
        }
    }

    /// Splits edges that are long on the graph.
    fn split(&mut self) {
        for _ in 0..SPLITS {
            let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
            for t in &self.mesh.triangles {
                for (a, b) in sides(t) {
                    let (p, q) = (self.at[a as usize], self.at[b as usize]);
                    let middle = self.graph.middle(p, q);
                    let room = [p, q, middle].map(|s| self.graph.room[s as usize]);
                    let long = self.graph.distance(p, q) > SHORT * room[0].min(room[1]).min(room[2]);
                    let key = (a.min(b), a.max(b));
                    if long && middle != p && middle != q && !middles.contains_key(&key) {
                        middles.insert(key, self.mesh.points.len() as u32);
                        let place = (self.mesh.points[a as usize] + self.mesh.points[b as usize]) * 0.5;
                        self.mesh.points.push(place);
                        self.at.push(middle);
                    }
                }
            }
            if middles.is_empty() {
                break;
            }
            self.mesh.split(&middles);
        }
    }

    /// Draws the surroundings of every node of the graph into it, as far as edges across it reach.
    fn draw_in(&mut self) {
        let graph = &self.graph;
        let mut reach = vec![0.0_f64; graph.nodes];
        for t in &self.mesh.triangles {
            for (a, b) in sides(t) {
                let (p, q) = (self.at[a as usize], self.at[b as usize]);
                let whole = graph.distance(p, q);
                for (node, reach) in reach.iter_mut().enumerate() {
                    let (d, e) = (graph.distance(p, node as u32), graph.distance(q, node as u32));
                    if d + e <= whole * (1.0 + 1e-5) + 1e-9 {
                        *reach = reach.max(d.max(e));
                    }
                }
            }
        }
        let moved: Vec<u32> = self.at.iter().map(|s| graph.drawn_in(*s, &reach)).collect();
        self.at = moved;
    }
}

fn sides(t: &[u32; 3]) -> [(u32, u32); 3] {
    [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]
}

fn neighbours(count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut found = vec![Vec::new(); count];
    for t in triangles {
        for k in 0..3 {
            found[t[k] as usize].push(t[(k + 1) % 3]);
        }
    }
    found
}

/// The nearest fixed vertex's node for every vertex, by distance along edges; a part of the surface
/// without any is at the place of the graph that is nearest to one of its vertices.
fn spread(graph: &Samples, points: &[Point], neighbours: &[Vec<u32>], fixed: &[u32]) -> Vec<u32> {
    let mut at = vec![u32::MAX; points.len()];
    let mut best = vec![f64::INFINITY; points.len()];
    let mut heap = BinaryHeap::new();
    for (v, node) in fixed.iter().enumerate().filter(|(_, n)| **n != u32::MAX) {
        best[v] = 0.0;
        at[v] = *node;
        heap.push(Reverse((0_u64, v)));
    }
    while let Some(Reverse((bits, v))) = heap.pop() {
        if f64::from_bits(bits) > best[v] {
            continue;
        }
        for w in neighbours[v].iter().map(|w| *w as usize) {
            let length = best[v] + (points[w] - points[v]).norm();
            if length < best[w] {
                best[w] = length;
                at[w] = at[v];
                // Distances are not negative, so their bits are in order.
                heap.push(Reverse((length.to_bits(), w)));
            }
        }
    }
    for start in 0..at.len() {
        if at[start] == u32::MAX {
            let place = graph.nearest(&points[start]);
            let mut stack = vec![start];
            while let Some(v) = stack.pop() {
                at[v] = place;
                stack.extend(neighbours[v].iter().map(|w| *w as usize).filter(|w| at[*w] == u32::MAX));
            }
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::control_nodes::{control_nodes, Placement};
    use crate::caging::rings::Start as Rings;
    use crate::caging::sections::tests::unwatched_sections;
    use crate::caging::sections::{SectionOptions, Traced};
    use crate::caging::skeleton::curve_skeleton;
    use crate::caging::skin::Skin;
    use crate::caging::tubes::scaffold;
    use crate::fixtures::shapes::square_tube;

    #[test]
    fn a_coarse_bar_becomes_a_thread_inside_small_rings() {
        // Two rings only: every side is one long face, which has to be split to follow the axis.
        let (vertices, faces) = square_tube(&[(0.0, 1.0), (10.0, 1.0)]);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let bones = [Point::new(1.0, 0.0, 0.0), Point::new(5.0, 0.5, 0.0), Point::new(9.0, 0.0, 0.0)];
        let skeleton = curve_skeleton(&skin, &bones, &[[0, 1], [1, 2]], 0.0, &[]).expect("inside");
        let nodes = control_nodes(&skin, &skeleton, Some(&[bones[1]]), Placement::Joints).expect("three");
        let options = SectionOptions::default();
        let found = unwatched_sections(&Traced::default(), &skin, &skeleton, &nodes, &options);
        let small = Rings::Regular(0.1).corners(&nodes, &found);
        let built = scaffold(&skeleton, &nodes, &found, small).expect("no branches");
        let mesh = Mesh { points: skin.points.clone(), triangles: skin.triangles.clone() };
        let begun = start(&built, &found, &mesh, (&THREADS, &[])).expect("a start");
        assert!(begun.rest.triangles.len() > mesh.triangles.len());
        let tree = Bvh::new(&begun.cage, &built.triangles());
        assert_eq!(verify::first_outside(&tree, &begun.cage, &begun.obstacle, &begun.rest.triangles), None);
    }
}
