//! A cage from a skin and its skeleton.
//!
//! Based on [CLM*19]: Casti, Livesu, Mellado, Abu Rumman, Scateni, Barthe, Puppo, *Skeleton Based
//! Cage Generation Guided by Harmonic Fields*, Computers & Graphics 81, 2019. [`Generator`] holds
//! skin and skeleton; [`Generator::sections`] is quick, for previews; [`Generator::generate`] goes
//! all the way and hands out nothing that the exact check in [`verify`] has not passed.
//! Every stage but the last works in a space where the skin has size 1.

mod alike;
mod axis_samples;
mod contacts;
mod contraction;
pub(crate) mod control_nodes;
mod counterpart;
mod energy;
mod extraction;
pub(crate) mod field;
mod finishing;
mod fitting;
mod inflation;
mod lineage;
mod obstacle;
mod pruning;
mod regrowth;
mod report;
mod rings;
mod sections;
pub(crate) mod skeleton;
mod skin;
mod surface_distance;
mod symmetry;
mod template;
mod tightening;
mod tips;
mod transplant;
mod tubes;
mod turning;
mod verify;

pub use control_nodes::{NodeKind, Placement};
pub use extraction::{extract_skeleton, ExtractedSkeleton};
pub use fitting::RoughCage;
pub use inflation::InflationOptions;
pub use regrowth::Earlier;
pub use report::{ArcReport, CageReport, Laps, SectionReport};
pub use sections::SectionOptions;
pub use skin::{Repairs, Skin};
pub use template::Template;

use crate::error::CagingError;
use crate::mesh::Polygons;
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use contraction::{Start, THREADS};
use control_nodes::{control_nodes, ControlNode};
use finishing::Clock;
use inflation::Inflation;
use obstacle::{Mesh, Obstacles};
use rings::STARTS;
use sections::{Section, Traced};
use skeleton::{curve_skeleton, CurveSkeleton};
use std::sync::OnceLock;
use tubes::{scaffold, Scaffold};

/// How a cage is generated.
#[derive(Debug, Clone, Copy, Default)]
pub struct CagingOptions {
    /// Bending nodes where the user gives none.
    pub placement: Placement,
    /// Windows and corners of sections.
    pub sections: SectionOptions,
    /// Distances and tightness.
    pub inflation: InflationOptions,
    /// Triangles instead of quads.
    pub triangles: bool,
    /// Leaves of the skeleton thinner than this (radius over the skin's diagonal) get no branch.
    pub detail: f64,
    /// Leave a symmetric character's cage as it comes.
    pub asymmetric: bool,
}

impl CagingOptions {
    fn check(&self) -> Result<(), CagingError> {
        let Self { sections, inflation, detail, .. } = self;
        let lengths = [
            ("reach", inflation.reach, 1e-4, 0.1),
            ("clearance", inflation.clearance, 1e-5, 0.05),
            ("tightness", inflation.tightness, 0.0, 100.0),
            ("detail", *detail, 0.0, 1.0),
            ("grid", sections.grid as f64, 12.0, 160.0),
            ("corners", sections.corners as f64, 3.0, 8.0),
            ("rounds", inflation.rounds as f64, 0.0, 1000.0),
        ];
        match lengths.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(CagingError::Option { name, value, low, high }),
            None => Ok(()),
        }
    }
}

/// A skin and its skeleton, ready for sections and cages. Sections are kept by what they depend on
/// (their node and the skeleton in their window), so that another call traces only those that
/// changed.
#[derive(Debug)]
pub struct Generator {
    skin: Skin,
    skeleton: CurveSkeleton,
    options: CagingOptions,
    graph: (Vec<Point>, Vec<[i64; 2]>),
    traced: Traced,
    obstacles: OnceLock<Obstacles>,
}

/// Control nodes, their sections, and for each corner its mirror image on a symmetric character.
type CrossSections = (Vec<ControlNode>, Vec<Section>, Option<Vec<u32>>);

/// What a cage is made of.
struct Plan {
    nodes: Vec<ControlNode>,
    sections: Vec<Section>,
    /// The faces that join the sections.
    scaffold: Scaffold,
    /// For each corner its mirror image on a symmetric character.
    mirror: Option<Vec<u32>>,
    /// Nodes of the skeleton that take no part.
    dropped: Vec<usize>,
}

/// When a cage fails with all leaves, leaves thinner than these are left out, one after the other.
const COARSER: [f64; 2] = [0.005, 0.012];
/// So many leaves may be left out where no cage closes around their branching node.
const CUTS: usize = 24;

/// A valid cage.
#[derive(Debug, Clone)]
pub struct GeneratedCage {
    /// `#C by 3`, the skin's space.
    pub vertices: Vec<Point>,
    /// Outward; quads and triangles, or triangles alone.
    pub faces: Polygons,
    /// How it came about.
    pub report: CageReport,
}

/// Why one attempt at a cage failed.
enum Failure {
    /// No start is free of crossings at this junction.
    Junction(usize, CagingError),
    Other(CagingError),
}

impl From<CagingError> for Failure {
    fn from(fault: CagingError) -> Self {
        Self::Other(fault)
    }
}

impl From<Cancelled> for Failure {
    fn from(cancelled: Cancelled) -> Self {
        Self::Other(cancelled.into())
    }
}

impl Generator {
    /// Takes a skin (`vertices` `#V by 3`, closed) and a skeleton graph (`nodes` `#N by 3`, `edges`
    /// pairs of nodes), both in one space.
    pub fn new(
        vertices: &[Point],
        faces: &Polygons,
        nodes: &[Point],
        edges: &[[i64; 2]],
        options: CagingOptions,
    ) -> Result<Self, CagingError> {
        options.check()?;
        let mut skin = Skin::new(vertices, faces)?;
        skin.symmetric = !options.asymmetric && symmetry::is_symmetric(&skin);
        let mirrored = if skin.symmetric { symmetry::mirror_graph(&skin, nodes, edges) } else { None };
        let graph = mirrored.unwrap_or_else(|| (nodes.to_vec(), edges.to_vec()));
        let skeleton = curve_skeleton(&skin, &graph.0, &graph.1, options.detail, &[])?;
        Ok(Self { skin, skeleton, options, graph, traced: Traced::default(), obstacles: OnceLock::new() })
    }

    /// Control nodes and their cross sections; `bending`: the user's nodes, near the skeleton.
    pub fn sections(
        &self,
        bending: Option<&[Point]>,
        part: &Part,
    ) -> Result<Vec<SectionReport>, CagingError> {
        let (nodes, sections, _) = self.cross_sections(&self.skeleton, bending, &[], part)?;
        Ok(report::sections(&self.skin, &nodes, &sections))
    }

    /// The skeleton as it is used: clipped, recentred and pruned, arc after arc.
    pub fn arcs(&self) -> Vec<ArcReport> {
        report::arcs(&self.skin, &self.skeleton)
    }

    /// What was done to the skin.
    pub fn repairs(&self) -> Repairs {
        self.skin.repairs
    }

    fn cross_sections(
        &self,
        skeleton: &CurveSkeleton,
        bending: Option<&[Point]>,
        turned: &[usize],
        part: &Part,
    ) -> Result<CrossSections, CagingError> {
        let mut nodes = control_nodes(&self.skin, skeleton, bending, self.options.placement)?;
        let partners = if self.skin.symmetric { symmetry::partners(&nodes) } else { None };
        if let Some(partners) = &partners {
            symmetry::mirror_nodes(&mut nodes, partners);
        }
        let options = &self.options.sections;
        let mut found =
            self.traced.sections(&self.skin, skeleton, &nodes, (options, partners.as_deref()), part)?;
        turned.iter().for_each(|at| found[*at] = found[*at].turned());
        let mirror = partners.and_then(|partners| symmetry::symmetrise(&nodes, &mut found, &partners));
        Ok((nodes, found, mirror))
    }

    /// The cage. `bending` as in [`Generator::sections`]. Without it, leaves of the skeleton are left
    /// out where no cage closes around their branching node, and thin ones (fingers) where no cage
    /// can be grown around them; the report names their nodes as dropped. What an `earlier` cage has
    /// around the same nodes stays as it is there, where that gives a good cage.
    pub fn generate(
        &self,
        bending: Option<&[Point]>,
        earlier: Option<&Earlier>,
        part: &Part,
    ) -> Result<GeneratedCage, CagingError> {
        if let Some(earlier) = earlier {
            if let Some(found) = self.regrow(bending, earlier, part)? {
                return Ok(found);
            }
        }
        let first = self.generate_with(self.skeleton.clone(), self.options.detail, bending, part);
        let fingers = |fault: &CagingError| bending.is_none() && fault.is_of_growth();
        if !first.as_ref().is_err_and(fingers) {
            return first;
        }
        let mut arcs = self.skeleton.arcs.len();
        for detail in COARSER {
            let coarser = curve_skeleton(&self.skin, &self.graph.0, &self.graph.1, detail, &[])?;
            if coarser.arcs.len() < arcs {
                arcs = coarser.arcs.len();
                match self.generate_with(coarser, detail, bending, part) {
                    Err(fault) if fault.is_of_growth() => {}
                    found => return found,
                }
            }
        }
        first
    }

    /// Leaves out leaves where no cage closes around their branching node.
    fn generate_with(
        &self,
        mut skeleton: CurveSkeleton,
        detail: f64,
        bending: Option<&[Point]>,
        part: &Part,
    ) -> Result<GeneratedCage, CagingError> {
        let mut without = Vec::new();
        loop {
            let (junction, fault) = match self.attempt(&skeleton, bending, &[], part) {
                Ok(found) => return self.widened(found, &skeleton, bending, part),
                Err(Failure::Other(fault)) => return Err(fault),
                Err(Failure::Junction(junction, fault)) => (junction, fault),
            };
            let cut = skeleton.least_leaf(junction).filter(|_| bending.is_none() && without.len() < CUTS);
            let Some(tip) = cut else { return Err(fault) };
            without.push(tip);
            skeleton = curve_skeleton(&self.skin, &self.graph.0, &self.graph.1, detail, &without)?;
        }
    }

    /// A cage with narrow faces is grown again with the sections there turned; the better one.
    fn widened(
        &self,
        found: GeneratedCage,
        skeleton: &CurveSkeleton,
        bending: Option<&[Point]>,
        part: &Part,
    ) -> Result<GeneratedCage, CagingError> {
        let turned = turning::narrow(&found);
        if turned.is_empty() {
            return Ok(found);
        }
        match self.attempt(skeleton, bending, &turned, part) {
            Err(Failure::Other(CagingError::Cancelled(cancelled))) => Err(cancelled.into()),
            Ok(other) if other.report.min_angle > found.report.min_angle => Ok(other),
            _ => Ok(found),
        }
    }

    /// `turned`: sections that have their corners elsewhere on their rings.
    fn attempt(
        &self,
        skeleton: &CurveSkeleton,
        bending: Option<&[Point]>,
        turned: &[usize],
        part: &Part,
    ) -> Result<GeneratedCage, Failure> {
        let mut clock = Clock::new();
        let [tracing, starting, growing, finishing] = part.split([1.0, 0.5, 4.0, 3.3]);
        tracing.begin("cross sections")?;
        let (nodes, sections, mirror) = self.cross_sections(skeleton, bending, turned, &tracing)?;
        clock.lap("sections");
        starting.begin("a start inside the skin")?;
        let obstacles = self.obstacles.get_or_init(|| Obstacles::of(&self.skin));
        let growth = &obstacles.growth;
        clock.lap("obstacle");
        let (scaffold, start) = self.start(skeleton, (&nodes, &sections), &growth.mesh, &starting)?;
        clock.lap("contraction");
        let plan = Plan { nodes, sections, scaffold, mirror, dropped: skeleton.dropped.clone() };
        Ok(self.grow((&plan, &[]), start, obstacles, (clock, [&growing, &finishing]))?)
    }

    /// From a start to the cage.
    fn grow(
        &self,
        (plan, quads): (&Plan, &[[u32; 4]]),
        start: Start,
        obstacles: &Obstacles,
        (mut clock, [growing, finishing]): (Clock, [&Part; 2]),
    ) -> Result<GeneratedCage, CagingError> {
        let growth = &obstacles.growth;
        growing.begin("growing the cage")?;
        let mut inflation =
            Inflation::new(&plan.scaffold, plan.mirror.as_deref(), start.cage.clone()).keep_quads(quads);
        let options = &self.options.inflation;
        let grown = inflation.grow(start, options, options.clearance + growth.margin, growing)?;
        if let Err(halt) = grown {
            let node = plan.nodes[plan.scaffold.owner[halt.vertex]].node;
            let place = self.skin.space.leave(&inflation.cage[halt.vertex]);
            return Err(CagingError::Stuck { node, place });
        }
        clock.lap("growth");
        self.finish(inflation, obstacles, plan, &[], (clock, finishing))
    }

    /// The faces, and a start free of crossings: the largest rings that have one.
    fn start(
        &self,
        skeleton: &CurveSkeleton,
        (nodes, sections): (&[ControlNode], &[Section]),
        obstacle: &Mesh,
        part: &Part,
    ) -> Result<(Scaffold, Start), Failure> {
        let mut fault = Failure::Other(CagingError::TooFewSections { sections: nodes.len() });
        for (k, rings) in STARTS.into_iter().enumerate() {
            part.reach(k as f64 / STARTS.len() as f64)?;
            let joined = match scaffold(skeleton, nodes, sections, rings.corners(nodes, sections)) {
                Ok(joined) => joined,
                Err(at) => {
                    let junction = &skeleton.junctions[at];
                    let place = self.skin.space.leave(&junction.point);
                    fault = Failure::Junction(at, CagingError::NoStart { node: junction.node, place });
                    continue;
                }
            };
            match contraction::start(&joined, sections, obstacle, (&THREADS, &[])) {
                Ok(start) => return Ok((joined, start)),
                Err(vertex) => {
                    let at = joined.owner[vertex];
                    let place = self.skin.space.leave(&joined.centers[at]);
                    let ends = skeleton.arcs[nodes[at].arc].ends;
                    let junction = ends[usize::from(skeleton.junctions[ends[0]].degree == 1)];
                    fault = Failure::Junction(junction, CagingError::NoStart { node: nodes[at].node, place });
                }
            }
        }
        Err(fault)
    }
}
