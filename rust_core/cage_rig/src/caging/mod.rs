//! A cage from a skin and its skeleton.
//!
//! Based on [CLM*19]: Casti, Livesu, Mellado, Abu Rumman, Scateni, Barthe, Puppo, *Skeleton Based
//! Cage Generation Guided by Harmonic Fields*, Computers & Graphics 81, 2019. [`Generator`] holds
//! skin and skeleton; [`Generator::sections`] is quick, for previews; [`Generator::generate`] goes
//! all the way and hands out nothing that the exact check in [`verify`] has not passed.
//! Every stage but the last works in a space where the skin has size 1.

mod contacts;
mod contraction;
pub(crate) mod control_nodes;
mod energy;
pub(crate) mod field;
mod inflation;
mod obstacle;
mod progress;
mod report;
mod sections;
pub(crate) mod skeleton;
mod skin;
mod symmetry;
mod tubes;
mod verify;

pub use control_nodes::{NodeKind, Placement};
pub use inflation::InflationOptions;
pub use progress::{Listener, Progress};
pub use report::{CageReport, SectionReport};
pub use sections::SectionOptions;
pub use skin::{Repairs, Skin};

use crate::error::CagingError;
use crate::mesh::Polygons;
use crate::points::Point;
use contraction::Start;
use control_nodes::{control_nodes, ControlNode};
use inflation::Inflation;
use sections::Section;
use skeleton::{curve_skeleton, CurveSkeleton};
use std::time::Instant;
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

/// A skin and its skeleton, ready for sections and cages.
#[derive(Debug, Clone)]
pub struct Generator {
    skin: Skin,
    skeleton: CurveSkeleton,
    options: CagingOptions,
    original: (Vec<Point>, Vec<[u32; 3]>),
    graph: (Vec<Point>, Vec<[i64; 2]>),
}

/// Control nodes, their sections, and for each corner its mirror image on a symmetric character.
type CrossSections = (Vec<ControlNode>, Vec<Section>, Option<Vec<u32>>);

/// When a cage fails with all leaves, leaves thinner than these are left out, one after the other.
const COARSER: [f64; 2] = [0.005, 0.012];

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
        let skin = Skin::new(vertices, faces)?;
        let skeleton = curve_skeleton(&skin, nodes, edges, options.detail)?;
        let original = (skin.original.clone(), skin.triangles.clone());
        Ok(Self { skin, skeleton, options, original, graph: (nodes.to_vec(), edges.to_vec()) })
    }

    /// Control nodes and their cross sections; `bending`: the user's nodes, near the skeleton.
    pub fn sections(
        &self,
        bending: Option<&[Point]>,
        progress: &Progress,
    ) -> Result<Vec<SectionReport>, CagingError> {
        let (nodes, sections, _) = self.cross_sections(bending, progress)?;
        Ok(report::sections(&self.skin, &nodes, &sections))
    }

    fn cross_sections(
        &self,
        bending: Option<&[Point]>,
        progress: &Progress,
    ) -> Result<CrossSections, CagingError> {
        let nodes = control_nodes(&self.skin, &self.skeleton, bending, self.options.placement)?;
        let mut found =
            sections::sections(&self.skin, &self.skeleton, &nodes, &self.options.sections, progress)?;
        let symmetric = !self.options.asymmetric && symmetry::is_symmetric(&self.skin);
        let mirror = if symmetric { symmetry::symmetrise(&nodes, &mut found) } else { None };
        Ok((nodes, found, mirror))
    }

    /// The cage. `bending` as in [`Generator::sections`]. Without it, thin leaves (fingers) that no
    /// cage can be grown for are left out; the report names their nodes as dropped.
    pub fn generate(
        &self,
        bending: Option<&[Point]>,
        progress: &Progress,
    ) -> Result<GeneratedCage, CagingError> {
        let first = self.attempt(bending, progress);
        if !first.as_ref().is_err_and(|fault| bending.is_none() && fault.is_of_growth()) {
            return first;
        }
        let mut arcs = self.skeleton.arcs.len();
        for detail in COARSER {
            let mut coarser = self.clone();
            coarser.skeleton = curve_skeleton(&self.skin, &self.graph.0, &self.graph.1, detail)?;
            if coarser.skeleton.arcs.len() < arcs {
                arcs = coarser.skeleton.arcs.len();
                match coarser.attempt(bending, progress) {
                    Err(fault) if fault.is_of_growth() => {}
                    found => return found,
                }
            }
        }
        first
    }

    fn attempt(&self, bending: Option<&[Point]>, progress: &Progress) -> Result<GeneratedCage, CagingError> {
        let mut clock = Clock::new();
        let (nodes, sections, mirror) = self.cross_sections(bending, progress)?;
        clock.lap("sections");
        let (proxy, margin) = obstacle::proxy(&self.skin);
        clock.lap("obstacle");
        let (scaffold, start) = self.start(&nodes, &sections, (&proxy.0, &proxy.1), progress)?;
        clock.lap("contraction");
        let mut inflation = Inflation::new(&scaffold, mirror.as_deref(), start.cage.clone());
        let options = &self.options.inflation;
        let least = options.clearance + margin;
        let grown = inflation.grow(start, (&proxy.0, &proxy.1), options, least, progress)?;
        if let Err(halt) = grown {
            let node = nodes[scaffold.owner[halt.vertex]].node;
            return Err(CagingError::Stuck {
                node,
                place: self.skin.space.leave(&inflation.cage[halt.vertex]),
            });
        }
        clock.lap("growth");
        inflation.tighten((&self.skin.points, &self.skin.triangles), options, progress)?;
        clock.lap("tightening");
        progress.step("verify", 0.0)?;
        let vertices: Vec<Point> = inflation.cage.iter().map(|p| self.skin.space.leave(p)).collect();
        let (skin, triangles) = (&self.original.0, &self.original.1);
        if let Some(fault) = verify::fault(&vertices, &scaffold.triangles(), skin, triangles) {
            let node = nodes[scaffold.owner[fault.vertex]].node;
            return Err(CagingError::NotValid { node, place: vertices[fault.vertex], fault: fault.what });
        }
        let faces = self.faces(&scaffold, &vertices);
        clock.lap("verify");
        let report = report::cage(self, (&nodes, &sections, &scaffold), &vertices, (mirror, clock.laps));
        Ok(GeneratedCage { vertices, faces, report })
    }

    /// The faces, and a start free of crossings: the largest sections that have one.
    fn start(
        &self,
        nodes: &[ControlNode],
        sections: &[Section],
        (points, triangles): (&[Point], &[[u32; 3]]),
        progress: &Progress,
    ) -> Result<(Scaffold, Start), CagingError> {
        let scales = [0.7, 0.5, 0.35, 0.25, 0.15, 0.08, 0.04];
        let mut fault = CagingError::TooFewSections { sections: nodes.len() };
        for (k, scale) in scales.into_iter().enumerate() {
            progress.step("contraction", k as f64 / scales.len() as f64)?;
            let joined = match scaffold(&self.skeleton, nodes, sections, scale) {
                Ok(joined) => joined,
                Err(junction) => {
                    let junction = &self.skeleton.junctions[junction];
                    let place = self.skin.space.leave(&junction.point);
                    fault = CagingError::NoStart { node: junction.node, place };
                    continue;
                }
            };
            match contraction::start(&joined, sections, points, triangles, scale) {
                Ok(start) => return Ok((joined, start)),
                Err(vertex) => {
                    let at = joined.owner[vertex];
                    let place = self.skin.space.leave(&joined.centers[at]);
                    fault = CagingError::NoStart { node: nodes[at].node, place };
                }
            }
        }
        Err(fault)
    }

    /// The cage's polygons. A quad stays one where both ways to split it are valid.
    fn faces(&self, scaffold: &Scaffold, vertices: &[Point]) -> Polygons {
        let triangles = scaffold.triangles();
        if self.options.triangles {
            return Polygons::from_triangles(&triangles);
        }
        let tree = crate::geometry::bvh::Bvh::new(&self.original.0, &self.original.1);
        let mut faces = Polygons::default();
        for polygon in &scaffold.polygons {
            let pieces = tubes::split(&scaffold.corners, polygon);
            let whole = pieces.len() == 2
                && verify::splits_either_way(
                    &pieces,
                    vertices,
                    &triangles,
                    (&self.original.0, &self.original.1),
                    &tree,
                );
            if whole {
                // Starts where a fan gives the verified triangles.
                let [a, b, c] = pieces[0];
                faces.corners.extend([a, b, c, pieces[1][2]].map(i64::from));
                faces.sizes.push(4);
            } else {
                for t in pieces {
                    faces.corners.extend(t.map(i64::from));
                    faces.sizes.push(3);
                }
            }
        }
        faces
    }
}

/// Seconds spent in each stage.
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, f64)>,
}

impl Clock {
    fn new() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    fn lap(&mut self, stage: &'static str) {
        let now = Instant::now();
        self.laps.push((stage, (now - self.last).as_secs_f64()));
        self.last = now;
    }
}
