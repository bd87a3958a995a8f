//! A cage after an edit of its nodes: what the edit leaves alone stays, the rest is pressed on anew.
//!
//! Sections that were there before keep their vertices, also where the artist has moved them. Others
//! begin on the earlier cage: a moved one where it was, a new one between its neighbours. They go to
//! their new places under the barrier and are tightened with their neighbours, while all else is held.
//! Where that gives no good cage there is none, and the whole is grown. Linear in the sections but for
//! the exact checks, and a tightening that looks at a part of the cage.

use super::counterpart::rearranged;
use super::energy::symmetrise_points;
use super::finishing::Clock;
use super::inflation::Inflation;
use super::lineage::Lineage;
use super::obstacle::{Mesh, Obstacles};
use super::report::NARROW;
use super::symmetry::image;
use super::transplant::{transplant, Rings, Transplanted};
use super::tubes::{Axis, Scaffold};
use super::{verify, GeneratedCage, Generator, Plan};
use crate::error::CagingError;
use crate::geometry::bvh::Bvh;
use crate::mesh::Polygons;
use crate::points::Point;
use crate::progress::Part;
use std::collections::HashSet;

/// A cage that was generated from the same skin and skeleton, with the same options.
#[derive(Debug, Clone)]
pub struct Earlier {
    /// Its bending nodes, where the user gave them.
    pub bending: Option<Vec<Point>>,
    /// Its vertices as they are now, section after section, `#C by 3`, the skin's space.
    pub vertices: Vec<Point>,
    /// Its faces.
    pub faces: Polygons,
    /// As the report of a cage like another one has it.
    pub arrangement: Option<Vec<i64>>,
}

/// How far new sections, and those next to a removed one, are widened for a start without crossings.
const WIDTHS: [(f64, f64); 7] =
    [(1.0, 1.0), (1.03, 1.0), (1.1, 1.0), (1.15, 1.1), (1.4, 1.2), (1.8, 1.5), (2.5, 2.0)];
/// How far a vertex may be from the image of its partner, relative to the size.
const MIRRORED: f64 = 1e-5;

impl Generator {
    /// The cage with other bending nodes. `None`: it has to be grown, also where nothing was edited.
    pub(super) fn regrow(
        &self,
        bending: Option<&[Point]>,
        earlier: &Earlier,
        part: &Part,
    ) -> Result<Option<GeneratedCage>, CagingError> {
        let mut clock = Clock::new();
        let [first, tracing, starting, finishing] = part.split([1.0, 1.0, 1.5, 2.0]);
        tracing.begin("cross sections")?;
        let arrangement = earlier.arrangement.as_deref();
        let Some(skeleton) =
            arrangement.map_or(Some(self.skeleton.clone()), |own| rearranged(&self.skeleton, own))
        else {
            return Ok(None);
        };
        let before = self.cross_sections(&skeleton, earlier.bending.as_deref(), &[], &first);
        let Some((before, _, _)) = unless_cancelled(before)? else { return Ok(None) };
        let (nodes, sections, mirror) = self.cross_sections(&skeleton, bending, &[], &tracing)?;
        clock.lap("sections");
        starting.begin("what the edit leaves alone")?;
        let count = sections.first().map_or(0, |s| s.corners.len());
        let vertices: Vec<Point> = earlier.vertices.iter().map(|p| self.skin.space.enter(p)).collect();
        let Some(faces) = faces(&earlier.faces, &vertices).filter(|_| vertices.len() == before.len() * count)
        else {
            return Ok(None);
        };
        let lineage = Lineage::new(&skeleton, &before, &nodes);
        if lineage.is_unchanged() {
            return Ok(None);
        }
        let symmetric = mirror.is_some();
        let old = Rings::new(vertices.clone(), faces, &before, count);
        let Some(eased) = self.eased(old.clone(), &lineage, symmetric, &starting)? else { return Ok(None) };
        let joined = joined(&old);
        let Some(faces) = transplant(eased, &vertices, (&nodes, &sections), &lineage) else {
            return Ok(None);
        };
        let mirror = if symmetric { mirrored(&faces.start) } else { None };
        let moves = touched(&joined, &faces.scaffold, &lineage, mirror.as_deref());
        let obstacles = self.obstacles.get_or_init(|| Obstacles::of(&self.skin));
        let fine = &obstacles.tightening;
        let Some(start) = start(&faces, &moves, mirror.as_deref(), &fine.mesh) else { return Ok(None) };
        clock.lap("start");
        let Transplanted { scaffold, origin, goal, .. } = faces;
        let held = |v: usize| origin[v].filter(|_| !moves[v]).map(|old| earlier.vertices[old]);
        let held: Vec<Option<Point>> = (0..moves.len()).map(held).collect();
        let plan = Plan { nodes, sections, scaffold, mirror, dropped: self.skeleton.dropped.clone() };
        let mut inflation = Inflation::new(&plan.scaffold, plan.mirror.as_deref(), start).hold(moves);
        inflation.approach(&goal, fine, &self.options.inflation, &starting)?;
        clock.lap("approach");
        let found = self.finish(inflation, obstacles, &plan, &held, (clock, &finishing));
        let found = unless_cancelled(found)?.filter(|cage| cage.report.min_angle >= NARROW);
        Ok(found.map(|cage| cage.arranged(arrangement)))
    }

    /// The rings of an earlier cage with those that go on the straight way between their neighbours;
    /// these give way where the skin bulges. `None` where a ring's neighbours aren't two, or cross.
    fn eased(
        &self,
        mut old: Rings,
        lineage: &Lineage,
        symmetric: bool,
        part: &Part,
    ) -> Result<Option<Rings>, CagingError> {
        let Some(links) = old.links(&lineage.gone) else { return Ok(None) };
        if links.is_empty() {
            return Ok(Some(old));
        }
        let mirror = if symmetric { mirrored(&old.vertices) } else { None };
        let mut moves = vec![false; old.vertices.len()];
        for v in links.iter().flat_map(|(v, [a, b])| [v, a, b]) {
            moves[*v as usize] = true;
            moves[mirror.as_ref().map_or(*v, |mirror| mirror[*v as usize]) as usize] = true;
        }
        let scaffold = Scaffold {
            corners: old.vertices.clone(),
            start: Vec::new(),
            owner: (0..old.vertices.len()).map(|v| v / old.count).collect(),
            centers: Vec::new(),
            polygons: old.faces.clone(),
            axis: Axis::default(),
        };
        let fine = &self.obstacles.get_or_init(|| Obstacles::of(&self.skin)).tightening;
        if !is_free(&old.vertices, &scaffold.triangles(), &fine.mesh) {
            return Ok(None);
        }
        let mut inflation = Inflation::new(&scaffold, mirror.as_deref(), old.vertices).hold(moves);
        inflation.straighten(&links, fine, &self.options.inflation, part)?;
        old.vertices = inflation.cage;
        Ok(Some(old))
    }
}

fn unless_cancelled<T>(found: Result<T, CagingError>) -> Result<Option<T>, CagingError> {
    match found {
        Err(CagingError::Cancelled(cancelled)) => Err(cancelled.into()),
        found => Ok(found.ok()),
    }
}

/// Faces one by one; `None` where they, or the vertices, can't be those of a cage.
pub(super) fn faces(polygons: &Polygons, vertices: &[Point]) -> Option<Vec<Vec<u32>>> {
    let mut corners = polygons.corners.iter();
    let mut found = Vec::new();
    for size in &polygons.sizes {
        let face: Vec<u32> = corners
            .by_ref()
            .take(*size)
            .map(|v| u32::try_from(*v).ok().filter(|v| (*v as usize) < vertices.len()))
            .collect::<Option<_>>()?;
        found.push(Some(face).filter(|face| face.len() >= 3 && face.len() == *size)?);
    }
    vertices.iter().all(|p| p.iter().all(|x| x.is_finite())).then_some(found)
}

/// For each point that at its mirror image; `None` where one has none.
fn mirrored(points: &[Point]) -> Option<Vec<u32>> {
    let of_point = |p: &Point| {
        let apart = |v: &usize| (points[*v] - image(p)).norm();
        let nearest = (0..points.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
        (apart(&nearest) < MIRRORED).then_some(nearest as u32)
    };
    let found: Vec<u32> = points.iter().map(of_point).collect::<Option<_>>()?;
    (0..points.len()).all(|v| found[found[v] as usize] as usize == v).then_some(found)
}

/// Pairs of sections that a face joins.
fn joined(rings: &Rings) -> HashSet<(usize, usize)> {
    let pairs = |face: &Vec<u32>| {
        let owners: Vec<usize> = face.iter().map(|v| rings.owner(*v)).collect();
        owners.iter().flat_map(|a| owners.iter().map(|b| (*a, *b))).collect::<Vec<_>>()
    };
    rings.faces.iter().flat_map(pairs).collect()
}

/// Whether each vertex moves: those of sections that are not the same, or are joined to others than
/// before; with their mirror images.
fn touched(
    before: &HashSet<(usize, usize)>,
    new: &Scaffold,
    lineage: &Lineage,
    mirror: Option<&[u32]>,
) -> Vec<bool> {
    let mut touched: Vec<bool> = lineage.same.iter().map(|same| !same).collect();
    for face in &new.polygons {
        for (v, w) in face.iter().flat_map(|v| face.iter().map(move |w| (v, w))) {
            let (a, b) = (new.owner[*v as usize], new.owner[*w as usize]);
            let old = lineage.origin[a].zip(lineage.origin[b]);
            let is_known = lineage.same[b] && old.is_some_and(|pair| before.contains(&pair));
            touched[a] |= !is_known;
        }
    }
    let moves = |v: usize| touched[new.owner[v]];
    let image = |v: usize| mirror.map_or(v, |mirror| mirror[v] as usize);
    (0..new.owner.len()).map(|v| moves(v) || moves(image(v))).collect()
}

/// The narrowest start in which nothing crosses.
fn start(
    faces: &Transplanted,
    moves: &[bool],
    mirror: Option<&[u32]>,
    obstacle: &Mesh,
) -> Option<Vec<Point>> {
    let Transplanted { scaffold, origin, start, .. } = faces;
    let triangles = scaffold.triangles();
    let count = start.len() / scaffold.centers.len().max(1);
    let middles: Vec<Point> =
        start.chunks(count).map(|ring| ring.iter().sum::<Point>() / count as f64).collect();
    WIDTHS.into_iter().find_map(|(fresh, beside)| {
        let place = |v: usize| {
            let width = match (origin[v], moves[v]) {
                (Some(_), false) => return start[v],
                (Some(_), true) => beside,
                (None, _) => fresh,
            };
            let middle = middles[scaffold.owner[v]];
            middle + (start[v] - middle) * width
        };
        let mut cage: Vec<Point> = (0..start.len()).map(place).collect();
        symmetrise_points(&mut cage, mirror, moves);
        is_free(&cage, &triangles, obstacle).then_some(cage)
    })
}

/// Whether a cage crosses neither itself nor the obstacle, which is inside.
fn is_free(cage: &[Point], triangles: &[[u32; 3]], obstacle: &Mesh) -> bool {
    verify::first_self_crossing(cage, triangles).is_none()
        && verify::first_outside(&Bvh::new(cage, triangles), cage, &obstacle.points, &obstacle.triangles)
            .is_none()
}
