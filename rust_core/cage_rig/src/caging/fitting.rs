//! A rough cage made to fit: the same vertices and faces, moved so that they enclose the skin, closely.
//!
//! For cages that were made by hand or decimated from the skin, which cross it: what nested cages
//! [SVJ15] do, with this generator's means. The skin is drawn in toward the axis of its skeleton as far as
//! the rough cage asks, where that is; growth, tightening and the last check are as of any other cage.
//! A rough cage has to hold the axis, leaves of the skeleton excepted, and must not cross itself.

use super::contacts::split_otherwise;
use super::contraction::{self, Start};
use super::control_nodes::ControlNode;
use super::finishing::Clock;
use super::obstacle::{Mesh, Obstacles};
use super::sections::Section;
use super::template::Pattern;
use super::tubes::{Axis, Scaffold};
use super::verify::{self, Fault};
use super::{GeneratedCage, Generator, Plan};
use crate::cage::Cage;
use crate::error::CagingError;
use crate::geometry::bvh::Bvh;
use crate::mesh::Polygons;
use crate::points::Point;
use crate::progress::Part;

/// A cage that is about where it is to be.
#[derive(Debug, Clone)]
pub struct RoughCage {
    /// `#C by 3`, the skin's space.
    pub vertices: Vec<Point>,
    /// Closed and manifold; quads may be split either way afterwards.
    pub faces: Polygons,
}

/// Distances of the skin from the axis at first, as of [`contraction::start`].
const THREADS: [(f64, f64); 7] = [
    (0.9, f64::INFINITY),
    (0.7, f64::INFINITY),
    (0.4, f64::INFINITY),
    (0.1, 0.5),
    (0.02, 0.1),
    (0.003, 0.02),
    (0.0005, 0.004),
];
/// How near the axis may come to the rough cage, how far a place outside looks for one inside at once, and how far
/// away that may be, relative to the size.
const ROOM: f64 = 5e-4;
const FAR: f64 = 0.05;
const AWAY: f64 = 0.1;
/// Of the axis the rough cage has to hold at least this part.
const LEAST: f64 = 0.5;
/// The axis is bent at so many places at most.
const BENDS: usize = 200;

impl Generator {
    /// The rough cage around the skin: valid, drawn tight, with its own faces index for index.
    pub fn fit(&self, rough: &RoughCage, part: &Part) -> Result<GeneratedCage, CagingError> {
        let mut clock = Clock::new();
        let [tracing, starting, growing, finishing] = part.split([1.0, 0.5, 4.0, 3.3]);
        let mut pattern = self.read(rough)?;
        tracing.begin("cross sections")?;
        let (nodes, sections, _) = self.cross_sections(&self.skeleton, None, &[], &tracing)?;
        clock.lap("sections");
        starting.begin("a start inside the skin")?;
        let mirror = if self.skin.symmetric && pattern.is_in_middle() { pattern.mirror() } else { None };
        if let Some(mirror) = &mirror {
            pattern.even_out(mirror);
        }
        let obstacles = self.obstacles.get_or_init(|| Obstacles::of(&self.skin));
        clock.lap("obstacle");
        let (axis, kept) = self.axis(&pattern, &nodes, &sections)?;
        let mut dropped = self.skeleton.dropped.clone();
        dropped.extend((0..nodes.len()).filter(|at| !kept.contains(at)).map(|at| nodes[at].node));
        let nodes: Vec<ControlNode> = kept.iter().map(|at| nodes[*at].clone()).collect();
        let sections: Vec<Section> = kept.iter().map(|at| sections[*at].clone()).collect();
        let (scaffold, start) = self.inside(&pattern, (axis, &nodes), &sections, &obstacles.growth.mesh)?;
        clock.lap("contraction");
        let plan = Plan { nodes, sections, scaffold, mirror, dropped };
        let quads = pattern.quads();
        let grown = self.grow((&plan, &quads), start, obstacles, (clock, [&growing, &finishing]));
        let mut found = grown.map_err(|fault| match fault {
            CagingError::Stuck { node, place } | CagingError::NotValid { node, place, .. } => {
                CagingError::RoughStuck { node, place }
            }
            fault => fault,
        })?;
        if let Some(Fault { vertex, .. }) = self.fault_of(&pattern, &found.vertices) {
            let node = plan.nodes[plan.scaffold.owner[vertex]].node;
            return Err(CagingError::RoughStuck { node, place: found.vertices[vertex] });
        }
        found.faces = pattern.polygons();
        Ok(found)
    }

    /// A rough cage in unit space, outward.
    fn read(&self, rough: &RoughCage) -> Result<Pattern, CagingError> {
        let cage = Cage::new(rough.vertices.clone(), &rough.faces)?;
        let vertices: Vec<Point> = rough.vertices.iter().map(|p| self.skin.space.enter(p)).collect();
        let mut faces: Vec<Vec<u32>> =
            rough.faces.iter().map(|face| face.iter().map(|v| *v as u32).collect()).collect();
        if cage.turned() {
            faces.iter_mut().for_each(|face| face.reverse());
        }
        let pattern = Pattern::loose(vertices, faces);
        if let Some(vertex) = verify::first_self_crossing(&pattern.vertices, &pattern.triangles()) {
            let vertex = vertex as usize;
            return Err(CagingError::RoughCrosses { vertex, place: rough.vertices[vertex] });
        }
        Ok(pattern)
    }

    /// The rough cage as a scaffold about the skin's axis, and the skin drawn in until it is inside.
    fn inside(
        &self,
        pattern: &Pattern,
        (axis, nodes): (Axis, &[ControlNode]),
        sections: &[Section],
        skin: &Mesh,
    ) -> Result<(Scaffold, Start), CagingError> {
        let centers = axis.points[..nodes.len()].to_vec();
        let nearest = |p: &Point| {
            let apart = |node: &usize| (centers[*node] - p).norm();
            (0..nodes.len()).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(0)
        };
        let scaffold = Scaffold {
            corners: pattern.vertices.clone(),
            start: pattern.vertices.clone(),
            owner: pattern.vertices.iter().map(nearest).collect(),
            centers,
            polygons: pattern.triangles().iter().map(|t| t.to_vec()).collect(),
            axis,
        };
        let others = split_otherwise(&pattern.quads());
        match contraction::start(&scaffold, sections, skin, (&THREADS, &others)) {
            Ok(start) => Ok((scaffold, start)),
            Err(vertex) => {
                let node = nodes[scaffold.owner[vertex]].node;
                let place = self.skin.space.leave(&pattern.vertices[vertex]);
                Err(CagingError::RoughMisses { node, place })
            }
        }
    }

    /// The axis of the skin, drawn into the rough cage where it is outside; and the control nodes on its largest
    /// part, where it falls apart.
    fn axis(
        &self,
        pattern: &Pattern,
        nodes: &[ControlNode],
        sections: &[Section],
    ) -> Result<(Axis, Vec<usize>), CagingError> {
        let centers: Vec<Point> = sections.iter().map(|section| section.center).collect();
        let along = Axis::along(&self.skeleton, nodes, &centers);
        let whole = along.length();
        let mut axis = Room::new(pattern).draw_in(along);
        let part = largest_part(axis.points.len(), &axis.edges);
        let kept: Vec<usize> = (0..nodes.len()).filter(|node| part[*node]).collect();
        axis.edges.retain(|(a, _)| part[*a]);
        if axis.length() < LEAST * whole || kept.len() < 2 {
            let outside = (0..nodes.len()).find(|node| !part[*node]).unwrap_or(0);
            let place = self.skin.space.leave(&nodes[outside].point);
            return Err(CagingError::RoughMisses { node: nodes[outside].node, place });
        }
        let bends = (nodes.len()..axis.points.len()).filter(|at| part[*at]);
        let order: Vec<usize> = kept.iter().copied().chain(bends).collect();
        let mut number = vec![usize::MAX; axis.points.len()];
        order.iter().enumerate().for_each(|(new, old)| number[*old] = new);
        let points = order.iter().map(|at| axis.points[*at]).collect();
        let edges = axis.edges.into_iter().map(|(a, b)| (number[a], number[b])).collect();
        Ok((Axis { points, edges }, kept))
    }
}

/// Whether each point is in the part of a graph with the most points.
fn largest_part(points: usize, edges: &[(usize, usize)]) -> Vec<bool> {
    let mut part: Vec<usize> = (0..points).collect();
    loop {
        let before = part.clone();
        for &(a, b) in edges {
            let least = part[a].min(part[b]);
            (part[a], part[b]) = (least, least);
        }
        if part == before {
            break;
        }
    }
    let size = |of: usize| part.iter().filter(|other| **other == of).count();
    let largest = part.iter().copied().max_by_key(|of| (size(*of), usize::MAX - of));
    part.iter().map(|of| Some(*of) == largest).collect()
}

/// What a rough cage encloses.
struct Room<'a> {
    vertices: &'a [Point],
    tree: Bvh,
    /// Of its quads, split otherwise.
    folded: Bvh,
}

impl<'a> Room<'a> {
    fn new(pattern: &'a Pattern) -> Self {
        let vertices = &pattern.vertices[..];
        let [tree, folded] =
            [pattern.triangles(), split_otherwise(&pattern.quads())].map(|t| Bvh::new(vertices, &t));
        Self { vertices, tree, folded }
    }

    /// An axis inside, bent where it has to be, and without the edges that find no way.
    fn draw_in(&self, axis: Axis) -> Axis {
        let Axis { mut points, edges: mut left } = axis;
        let mut inside: Vec<bool> = Vec::new();
        for p in &mut points {
            let entered = self.enter(*p);
            inside.push(entered.is_some());
            *p = entered.unwrap_or(*p);
        }
        let mut edges = Vec::new();
        let own = points.len();
        while let Some((a, b)) = left.pop() {
            let (p, q) = (points[a], points[b]);
            if inside[a] && inside[b] && self.is_clear(&p, &q) {
                edges.push((a, b));
            } else if let Some(middle) = self.enter((p + q) * 0.5).filter(|_| points.len() < own + BENDS) {
                let halves = [(p - middle).norm(), (q - middle).norm()];
                if halves.into_iter().all(|half| half < 0.99 * (q - p).norm()) {
                    left.extend([(a, points.len()), (points.len(), b)]);
                    points.push(middle);
                    inside.push(true);
                }
            }
        }
        self.straighten(&points, &mut edges, own);
        Axis { points, edges }
    }

    /// Distance to the faces, negative outside.
    fn depth(&self, p: &Point) -> f64 {
        let near = [&self.tree, &self.folded].into_iter().filter_map(|tree| tree.nearest(self.vertices, p));
        let distance = near.map(|near| near.distance).fold(f64::INFINITY, f64::min);
        if self.tree.winding(self.vertices, p) == 1 {
            distance
        } else {
            -distance
        }
    }

    /// A place inside, a little away from the faces, not far uphill from `p`; itself, where it is one.
    fn enter(&self, from: Point) -> Option<Point> {
        let mut p = from;
        let mut depth = self.depth(&p);
        let mut step = FAR;
        while depth < ROOM && step > 0.1 * ROOM {
            let ways = (0..27)
                .filter(|k| *k != 13)
                .map(|k| Point::from_fn(|i, _| f64::from(k / 3_i32.pow(i as u32) % 3 - 1)));
            let around = ways.map(|way| p + way.normalize() * step).map(|q| (self.depth(&q), q));
            match around.max_by(|x, y| x.0.total_cmp(&y.0)) {
                Some(best) if best.0 > depth => (depth, p) = best,
                _ => step *= 0.5,
            }
        }
        (depth >= ROOM && (p - from).norm() < AWAY).then_some(p)
    }

    /// Leaves out bends, points from number `own` on, wherever their neighbours see one another.
    fn straighten(&self, points: &[Point], edges: &mut Vec<(usize, usize)>, own: usize) {
        for bend in (own..points.len()).chain((own..points.len()).rev()) {
            let touches = |(a, b): &(usize, usize)| *a == bend || *b == bend;
            let ends: Vec<usize> = edges.iter().filter(|e| touches(e)).map(|(a, b)| a + b - bend).collect();
            if let [a, b] = ends[..] {
                if a != b && self.is_clear(&points[a], &points[b]) {
                    edges.retain(|e| !touches(e));
                    edges.push((a, b));
                }
            }
        }
    }

    /// Whether the way from `p` to `q` stays inside. Each step is as long as the room around allows.
    fn is_clear(&self, p: &Point, q: &Point) -> bool {
        let length = (q - p).norm();
        let mut gone = 0.0;
        while gone < length {
            let depth = self.depth(&(p + (q - p) * (gone / length)));
            if depth < 0.5 * ROOM {
                return false;
            }
            gone += depth;
        }
        self.depth(q) >= 0.5 * ROOM
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::CagingOptions;
    use crate::fixtures::shapes::square_tube;
    use crate::progress::Progress;

    fn generator() -> Generator {
        let (vertices, faces) = square_tube(&[(0.0, 1.0), (3.0, 1.4), (7.0, 1.4), (10.0, 1.0)]);
        let bones = [1.0, 5.0, 9.0].map(|x| Point::new(x, 0.0, 0.0));
        Generator::new(&vertices, &faces, &bones, &[[0, 1], [1, 2]], CagingOptions::default())
            .expect("closed")
    }

    fn rough(rings: &[(f64, f64)]) -> RoughCage {
        let (vertices, faces) = square_tube(rings);
        RoughCage { vertices, faces }
    }

    fn fitted(rough: &RoughCage) -> Result<GeneratedCage, CagingError> {
        generator().fit(rough, &Progress::default().whole())
    }

    #[test]
    fn a_cage_that_crosses_the_skin_is_drawn_around_it_with_its_own_faces() {
        let rough = rough(&[(0.5, 0.8), (5.0, 1.0), (9.0, 0.8)]);
        let found = fitted(&rough).expect("a cage");
        assert_eq!((&found.faces.corners, &found.faces.sizes), (&rough.faces.corners, &rough.faces.sizes));
        assert!(found.report.clearance >= 1e-4 && found.report.volume_ratio > 1.0);
        assert!(found.report.volume_ratio < 1.2, "{}", found.report.volume_ratio);
    }

    #[test]
    fn a_wide_cage_is_drawn_close_and_one_inside_out_is_turned() {
        let mut rough = rough(&[(-3.0, 4.0), (5.0, 4.0), (13.0, 4.0)]);
        let wide = fitted(&rough).expect("a cage");
        assert!(wide.report.volume_ratio < 1.2, "{}", wide.report.volume_ratio);
        let mut corners = rough.faces.corners.clone();
        corners.reverse();
        rough.faces = Polygons { corners, sizes: rough.faces.sizes.iter().rev().copied().collect() };
        let turned = fitted(&rough).expect("a cage");
        assert!((turned.report.volume_ratio - wide.report.volume_ratio).abs() < 0.01);
    }

    #[test]
    fn what_can_not_be_fitted_is_named() {
        let elsewhere = rough(&[(20.0, 1.0), (25.0, 1.0), (30.0, 1.0)]);
        let refused = fitted(&elsewhere).expect_err("it is elsewhere");
        assert!(matches!(refused, CagingError::RoughMisses { .. }), "{refused}");
        let mut open = rough(&[(0.0, 1.0), (5.0, 1.0), (10.0, 1.0)]);
        open.faces.sizes.pop();
        open.faces.corners.truncate(open.faces.sizes.iter().sum());
        assert!(matches!(fitted(&open), Err(CagingError::Rough(_))));
        let mut crossing = rough(&[(0.0, 1.0), (5.0, 1.0), (10.0, 1.0)]);
        for p in &mut crossing.vertices[8..] {
            p.x = 2.0;
            p.y += 0.5;
        }
        assert!(matches!(fitted(&crossing), Err(CagingError::RoughCrosses { .. })));
    }

    #[test]
    fn the_largest_part_of_a_graph_is_found() {
        assert_eq!(largest_part(5, &[(3, 1), (4, 3), (0, 2)]), [false, true, false, true, true]);
    }
}
