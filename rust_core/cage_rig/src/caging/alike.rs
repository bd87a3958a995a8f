//! A cage like another one: its sections, the order of its vertices, and its faces, around another skin.
//!
//! For the levels of detail of one character, so that what is made for one cage fits them all. The
//! skeleton's arcs are put in the template's order, each with as many sections, whose corners are those
//! ring points that lie as the template's do. The cage begins where the template is, as far as that
//! holds a contracted skin, else from small rings; growth, tightening and the last check are as always.

use super::contacts::split_otherwise;
use super::contraction::{self, Start, IN_PLACE, THREADS};
use super::control_nodes::{control_nodes, on_arcs, ControlNode, NodeKind};
use super::counterpart::{as_before, contracted, counterparts, rearranged, Arrangement, Match};
use super::energy::symmetrise;
use super::finishing::Clock;
use super::obstacle::Obstacles;
use super::regrowth::Earlier;
use super::report::{self, SectionReport, NARROW};
use super::rings::STARTS;
use super::sections::{toward, Section};
use super::skeleton::{curve_skeleton, Arc, CurveSkeleton};
use super::symmetry;
use super::template::{center, Chain, End, Pattern, Template};
use super::tubes::{Axis, Scaffold};
use super::verify::{self, Fault};
use super::{CrossSections, GeneratedCage, Generator, Plan};
use crate::error::CagingError;
use crate::geometry::bvh::Bvh;
use crate::points::Point;
use crate::progress::Part;

/// No better place is looked for where a skeleton's arcs are as near to their chains, relative to the size.
const NEAR: f64 = 0.05;

impl Generator {
    /// A cage with the faces of `template`, index for index, also after an edit of an `earlier` one where
    /// its sections are as many. `bending` as in [`Generator::sections`], as many on each arc as the template
    /// has; without it, where the template's sections are.
    pub fn generate_like(
        &self,
        bending: Option<&[Point]>,
        template: &Template,
        earlier: Option<&Earlier>,
        part: &Part,
    ) -> Result<GeneratedCage, CagingError> {
        let pattern = template.read(&self.skin, self.options.sections.corners)?;
        if let Some(earlier) = earlier {
            if let Some(mut found) = self.regrow(bending, earlier, part)? {
                let is_like = found.vertices.len() == pattern.vertices.len();
                if !is_like || self.fault_of(&pattern, &found.vertices).is_none() {
                    found.faces = if is_like { template.faces.clone() } else { found.faces };
                    return Ok(found);
                }
            }
        }
        let mut clock = Clock::new();
        let [tracing, starting, growing, finishing] = part.split([1.0, 0.5, 4.0, 3.3]);
        tracing.begin("cross sections")?;
        let (skeleton, mut pattern, arrangement) = self.counterpart(&pattern)?;
        let (nodes, sections, mirror) = self.sections_like((&skeleton, &mut pattern), bending, &tracing)?;
        clock.lap("sections");
        starting.begin("a start inside the skin")?;
        let obstacles = self.obstacles.get_or_init(|| Obstacles::of(&self.skin));
        clock.lap("obstacle");
        let mut refused = CagingError::TooFewSections { sections: nodes.len() };
        let mut best: Option<GeneratedCage> = None;
        for in_place in [true, false] {
            let grown = self
                .begin(in_place, (&skeleton, &pattern), (&nodes, &sections, mirror.as_deref()), obstacles)
                .and_then(|(scaffold, start)| {
                    clock.lap("contraction");
                    let (nodes, sections) = (nodes.clone(), sections.clone());
                    let dropped = skeleton.dropped.clone();
                    let plan = Plan { nodes, sections, scaffold, mirror: mirror.clone(), dropped };
                    self.grow(
                        (&plan, &pattern.quads()),
                        start,
                        obstacles,
                        (clock.clone(), [&growing, &finishing]),
                    )
                });
            match grown {
                Ok(mut cage) => match self.fault_of(&pattern, &cage.vertices) {
                    None => {
                        cage.faces = template.faces.clone();
                        let angle = cage.report.min_angle;
                        if best.as_ref().is_none_or(|other| other.report.min_angle < angle) {
                            best = Some(cage.arranged(Some(&arrangement)));
                        }
                        if angle >= NARROW {
                            break;
                        }
                    }
                    Some(Fault { vertex, what }) => {
                        let node = nodes[vertex / pattern.count].node;
                        refused = CagingError::NotValid { node, place: cage.vertices[vertex], fault: what };
                    }
                },
                Err(fault) if fault.is_of_growth() => refused = fault,
                Err(fault) => return Err(fault),
            }
        }
        best.ok_or(refused)
    }

    /// Control nodes and their sections for a cage like `template`.
    pub fn preview_like(
        &self,
        bending: Option<&[Point]>,
        template: &Template,
        part: &Part,
    ) -> Result<Vec<SectionReport>, CagingError> {
        let pattern = template.read(&self.skin, self.options.sections.corners)?;
        let (skeleton, mut pattern, arrangement) = self.counterpart(&pattern)?;
        let (nodes, sections, _) = self.sections_like((&skeleton, &mut pattern), bending, part)?;
        let mut found = report::sections(&self.skin, &nodes, &sections);
        as_before(&mut found, &arrangement);
        Ok(found)
    }

    /// The skeleton with its arcs as the template has them, without leaves that it lacks; and the template
    /// where the skin is: where it is already, or moved and scaled.
    fn counterpart(&self, pattern: &Pattern) -> Result<(CurveSkeleton, Pattern, Arrangement), CagingError> {
        let here = self.matched(pattern);
        if here.as_ref().is_ok_and(|(_, _, apart)| *apart < NEAR) {
            return here.map(|(skeleton, found, _)| (skeleton, pattern.clone(), found));
        }
        let mut moved = pattern.moved(onto_box(&pattern.vertices, &self.skin.points));
        let mut there = self.matched(&moved);
        for _ in 0..3 {
            let Ok((skeleton, _, _)) = &there else { break };
            moved = moved.moved(onto_arcs(&moved, skeleton));
            there = self.matched(&moved);
        }
        match (here, there) {
            (Ok(here), Ok(there)) if here.2 < there.2 => Ok((here.0, pattern.clone(), here.1)),
            (_, Ok((skeleton, found, _))) => Ok((skeleton, moved, found)),
            (here, _) => here.map(|(skeleton, found, _)| (skeleton, pattern.clone(), found)),
        }
    }

    fn matched(&self, pattern: &Pattern) -> Result<(CurveSkeleton, Arrangement, f64), CagingError> {
        let mut skeleton = self.skeleton.clone();
        let mut without = Vec::new();
        let mut numbers: Arrangement = (1..=skeleton.arcs.len() as i64).collect();
        loop {
            match counterparts(&skeleton, pattern)? {
                Match::All(found, apart) => {
                    let arranged = rearranged(&skeleton, &found).ok_or(CagingError::Unlike { section: 0 })?;
                    let number = |arc: &i64| arc.signum() * numbers[arc.unsigned_abs() as usize - 1];
                    return Ok((arranged, found.iter().map(number).collect(), apart));
                }
                Match::Short(arc) => {
                    skeleton = contracted(skeleton, arc);
                    numbers.remove(arc);
                    continue;
                }
                Match::Left(tip, section) if without.contains(&tip) => {
                    return Err(CagingError::Unlike { section });
                }
                Match::Left(tip, _) => without.push(tip),
            }
            let graph = &self.graph;
            skeleton = curve_skeleton(&self.skin, &graph.0, &graph.1, self.options.detail, &without)?;
            numbers = (1..=skeleton.arcs.len() as i64).collect();
        }
    }

    /// As many nodes on each arc as the template has, and sections with corners that lie as its do.
    fn sections_like(
        &self,
        (skeleton, pattern): (&CurveSkeleton, &mut Pattern),
        bending: Option<&[Point]>,
        part: &Part,
    ) -> Result<CrossSections, CagingError> {
        let mirror = if self.skin.symmetric { pattern.mirror() } else { None };
        if let Some(mirror) = &mirror {
            pattern.even_out(mirror);
        }
        let mut nodes = self.nodes_like((skeleton, pattern), bending)?;
        let partners = mirror.as_ref().and_then(|_| symmetry::partners(&nodes));
        if let Some(partners) = &partners {
            symmetry::mirror_nodes(&mut nodes, partners);
        }
        let options = (&self.options.sections, partners.as_deref());
        let mut found = self.traced.sections(&self.skin, skeleton, &nodes, options, part)?;
        let mirror =
            partners.and_then(|partners| symmetry::symmetrise(&nodes, &mut found, &partners)).and(mirror);
        for (at, section) in found.iter_mut().enumerate() {
            let targets = laid(pattern.section(at), &section.ring, &nodes[at].direction);
            section.corners = toward(&section.ring, &targets);
            section.widen(&nodes[at]);
        }
        let mut corners: Vec<Point> = found.iter().flat_map(|s| s.corners.iter().copied()).collect();
        symmetrise(&mut corners, mirror.as_deref());
        for (section, corners) in found.iter_mut().zip(corners.chunks(pattern.count)) {
            section.corners = corners.to_vec();
            section.center = center(corners);
        }
        Ok((nodes, found, mirror))
    }

    /// The template's sections as nodes; those that the user gives instead.
    fn nodes_like(
        &self,
        (skeleton, pattern): (&CurveSkeleton, &Pattern),
        bending: Option<&[Point]>,
    ) -> Result<Vec<ControlNode>, CagingError> {
        let nodes = if bending.is_some() {
            control_nodes(&self.skin, skeleton, bending, self.options.placement)?
        } else {
            let places = skeleton.arcs.iter().zip(&pattern.chains).map(|(arc, chain)| {
                let along = |s: usize| arc.nearest(&pattern.center(s)).1;
                spaced(chain.bending().map(along).collect(), arc.length())
            });
            on_arcs(&self.skin, skeleton, places.collect())?
        };
        for (at, chain) in pattern.chains.iter().enumerate() {
            let found = nodes.iter().filter(|n| n.arc == at).count();
            if found != chain.count {
                return Err(CagingError::OtherNodes { section: chain.first, wanted: chain.count, found });
            }
        }
        Ok(nodes)
    }

    /// Where the cage begins: the template where it is, around a skin drawn in only as far as it has to be;
    /// or its faces between small rings.
    fn begin(
        &self,
        in_place: bool,
        (skeleton, pattern): (&CurveSkeleton, &Pattern),
        (nodes, sections, mirror): (&[ControlNode], &[Section], Option<&[u32]>),
        obstacles: &Obstacles,
    ) -> Result<(Scaffold, Start), CagingError> {
        let threads = if in_place { &IN_PLACE[..] } else { &THREADS };
        let starts: Vec<(Vec<Point>, Vec<Point>)> = if in_place {
            vec![(self.shifted((skeleton, pattern), nodes), pattern.vertices.clone())]
        } else {
            let own: Vec<Point> = sections.iter().flat_map(|s| s.corners.iter().copied()).collect();
            STARTS.iter().map(|rings| (own.clone(), rings.corners(nodes, sections))).collect()
        };
        let others = split_otherwise(&pattern.quads());
        let mut fault = CagingError::TooFewSections { sections: nodes.len() };
        for (mut corners, mut start) in starts {
            symmetrise(&mut corners, mirror);
            symmetrise(&mut start, mirror);
            let scaffold = scaffold((skeleton, pattern), nodes, corners, start);
            match contraction::start(&scaffold, sections, &obstacles.growth.mesh, (threads, &others)) {
                Ok(start) => return Ok((scaffold, start)),
                Err(vertex) => {
                    let at = scaffold.owner[vertex];
                    let place = self.skin.space.leave(&scaffold.centers[at]);
                    fault = CagingError::NoStart { node: nodes[at].node, place };
                }
            }
        }
        Err(fault)
    }

    /// The template's sections, moved along with nodes that are not where they are.
    fn shifted(&self, (skeleton, pattern): (&CurveSkeleton, &Pattern), nodes: &[ControlNode]) -> Vec<Point> {
        let shift = |at: usize, node: &ControlNode| match node.kind {
            NodeKind::Leaf => Point::zeros(),
            NodeKind::Bending => {
                let arc = &skeleton.arcs[node.arc];
                node.place - arc.at(arc.nearest(&pattern.center(at)).1)
            }
        };
        let moved = |(at, node): (usize, &ControlNode)| {
            let shift = shift(at, node);
            pattern.section(at).iter().map(move |p| p + shift).collect::<Vec<_>>()
        };
        nodes.iter().enumerate().flat_map(moved).collect()
    }

    /// What is wrong with the template's faces between these vertices, its quads split in any way.
    pub(super) fn fault_of(&self, pattern: &Pattern, vertices: &[Point]) -> Option<Fault> {
        let skin = (&self.skin.original[..], &self.skin.triangles[..]);
        let mut possible = pattern.triangles();
        if let Some(fault) = verify::fault(vertices, &possible, skin.0, skin.1) {
            return Some(fault);
        }
        let tree = Bvh::new(skin.0, skin.1);
        let clear = 0.5 * self.options.inflation.clearance * self.skin.space.size;
        for [a, b, c, d] in pattern.quads() {
            let pieces = [[a, b, c], [a, c, d]];
            if !verify::splits_either_way(&pieces, vertices, &possible, skin, (&tree, clear)) {
                return Some(Fault { vertex: a as usize, what: "a quad can't be split both ways" });
            }
            possible.extend([[b, c, d], [b, d, a]]);
        }
        None
    }
}

/// What brings a cage to a skin, by their boxes: a scale and a shift.
fn onto_box(cage: &[Point], skin: &[Point]) -> (f64, Point) {
    let bounds = |points: &[Point]| {
        points.iter().fold((points[0], points[0]), |(low, high), p| (low.inf(p), high.sup(p)))
    };
    let ((low, high), (a, b)) = (bounds(cage), bounds(skin));
    let scale = (b - a).norm() / (high - low).norm().max(1e-300);
    (scale, (a + b) * 0.5 - (low + high) * (0.5 * scale))
}

/// What brings the sections of a template nearest to the arcs that take their place: a scale and a shift.
fn onto_arcs(pattern: &Pattern, skeleton: &CurveSkeleton) -> (f64, Point) {
    let of_chain = |(chain, arc): (&Chain, &Arc)| {
        let pair = |s: usize| (pattern.center(s), arc.at(arc.nearest(&pattern.center(s)).1));
        chain.sections().map(pair).collect::<Vec<_>>()
    };
    let pairs: Vec<(Point, Point)> = pattern.chains.iter().zip(&skeleton.arcs).flat_map(of_chain).collect();
    let n = pairs.len() as f64;
    let from = pairs.iter().map(|(p, _)| p).sum::<Point>() / n;
    let to = pairs.iter().map(|(_, q)| q).sum::<Point>() / n;
    let along: f64 = pairs.iter().map(|(p, q)| (p - from).dot(&(q - to))).sum();
    let square: f64 = pairs.iter().map(|(p, _)| (p - from).norm_squared()).sum();
    let scale = (along / square.max(1e-300)).clamp(0.5, 2.0);
    (scale, to - from * scale)
}

/// The template's faces as triangles, between `corners` and from `start`.
fn scaffold(
    (skeleton, pattern): (&CurveSkeleton, &Pattern),
    nodes: &[ControlNode],
    corners: Vec<Point>,
    start: Vec<Point>,
) -> Scaffold {
    let centers: Vec<Point> = corners.chunks(pattern.count).map(center).collect();
    let mut axis = Axis { points: centers.clone(), edges: Vec::new() };
    let mut around = vec![Vec::new(); pattern.branches.len()];
    for chain in &pattern.chains {
        axis.edges.extend(chain.sections().skip(1).map(|s| (s - 1, s)));
        for (end, section) in chain.ends.iter().zip([chain.first, chain.first + chain.count - 1]) {
            if let End::Branch(branch) = end {
                around[*branch].push(section);
            }
        }
    }
    for (chain, arc) in pattern.chains.iter().zip(&skeleton.arcs) {
        for (end, junction) in chain.ends.iter().zip(arc.ends) {
            let End::Branch(branch) = end else { continue };
            let members = std::mem::take(&mut around[*branch]);
            if !members.is_empty() {
                let mean = members.iter().map(|s| centers[*s]).sum::<Point>() / members.len() as f64;
                let at = axis.points.len();
                axis.points.push((mean + skeleton.junctions[junction].point) * 0.5);
                axis.edges.extend(members.into_iter().map(|section| (section, at)));
            }
        }
    }
    let mut built = Scaffold {
        owner: (0..corners.len()).map(|v| v / pattern.count).collect(),
        corners,
        start,
        centers,
        polygons: pattern.triangles().iter().map(|t| t.to_vec()).collect(),
        axis,
    };
    built.pull_leaves(nodes);
    built
}

/// The template's ring laid on another one: across its direction, about its middle, of its size.
fn laid(ring: &[Point], onto: &[Point], direction: &Point) -> Vec<Point> {
    let middle = center(ring);
    let n = ring.len();
    let around = (0..n).map(|k| (ring[k] - middle).cross(&(ring[(k + 1) % n] - middle))).sum::<Point>();
    let turn = around
        .try_normalize(1e-300)
        .and_then(|normal| nalgebra::Rotation3::rotation_between(&normal, direction))
        .unwrap_or_else(nalgebra::Rotation3::identity);
    let home = center(onto);
    let spread = |points: &[Point], middle: &Point| {
        let across = |p: &Point| (p - middle) - direction * direction.dot(&(p - middle));
        (points.iter().map(|p| across(p).norm_squared()).sum::<f64>() / points.len() as f64).sqrt()
    };
    let turned: Vec<Point> = ring.iter().map(|p| turn * (p - middle)).collect();
    let scale = spread(onto, &home) / spread(&turned, &Point::zeros()).max(1e-300);
    turned.iter().map(|p| home + p * scale).collect()
}

/// Places along an arc in order, none too near to another or to an end.
fn spaced(mut found: Vec<f64>, length: f64) -> Vec<f64> {
    let n = found.len();
    let gap = (0.5 * length / (n + 1) as f64).min(0.04);
    for k in 0..n {
        let least = if k == 0 { gap } else { found[k - 1] + gap };
        found[k] = found[k].max(least).min(length - gap * (n - k) as f64);
    }
    found
}
