//! The last stages of a cage: drawn tight, checked exactly, and handed out with its faces.

use super::inflation::Inflation;
use super::obstacle::Obstacles;
use super::report::{self, Laps};
use super::tightening::{DRAWN, SETTLED};
use super::{tubes, verify, GeneratedCage, Generator, Plan};
use crate::error::CagingError;
use crate::geometry::bvh::Bvh;
use crate::mesh::Polygons;
use crate::points::Point;
use crate::progress::Part;
use std::time::Instant;

impl Generator {
    /// Draws a cage tight, checks it and hands it out. `held`: vertices that stay, in the skin's space.
    pub(super) fn finish(
        &self,
        mut inflation: Inflation,
        obstacles: &Obstacles,
        plan: &Plan,
        held: &[Option<Point>],
        (mut clock, part): (Clock, &Part),
    ) -> Result<GeneratedCage, CagingError> {
        let [drawing, settling, opening, checking] = part.split([1.6, 0.8, 0.6, 0.3]);
        let options = &self.options.inflation;
        let Obstacles { growth, tightening: fine } = obstacles;
        drawing.begin("tightening the cage")?;
        let mut cages = vec![inflation.cage.clone()];
        // An edited cage is closer to the skin than the stand-in of growth allows, and needs less.
        if held.is_empty() {
            inflation.tighten(growth, &DRAWN, options, &drawing)?;
        }
        inflation.tighten(fine, &SETTLED, options, &settling)?;
        cages.push(inflation.cage.clone());
        if inflation.open_slivers(fine, options, &opening)? {
            cages.push(inflation.cage);
        }
        clock.lap("tightening");
        checking.begin("checking the cage")?;
        let vertices = self.last_valid(&cages, plan, held)?;
        let faces = self.faces(&plan.scaffold, &vertices);
        clock.lap("verify");
        let kept = held.iter().flatten().count();
        let report = report::cage(&self.skin, plan, &vertices, (kept, clock.laps));
        Ok(GeneratedCage { vertices, faces, report })
    }

    /// The last cage of several that the exact check passes, in the skin's space: tightening, around a
    /// stand-in, may have lost what growth had.
    fn last_valid(
        &self,
        cages: &[Vec<Point>],
        plan: &Plan,
        held: &[Option<Point>],
    ) -> Result<Vec<Point>, CagingError> {
        let Plan { nodes, scaffold, .. } = plan;
        let mut refused = CagingError::TooFewSections { sections: nodes.len() };
        for cage in cages.iter().rev() {
            let place = |(v, p): (usize, &Point)| {
                held.get(v).copied().flatten().unwrap_or_else(|| self.skin.space.leave(p))
            };
            let vertices: Vec<Point> = cage.iter().enumerate().map(place).collect();
            let (skin, triangles) = (&self.skin.original, &self.skin.triangles);
            let Some(fault) = verify::fault(&vertices, &scaffold.triangles(), skin, triangles) else {
                return Ok(vertices);
            };
            let node = nodes[scaffold.owner[fault.vertex]].node;
            refused = CagingError::NotValid { node, place: vertices[fault.vertex], fault: fault.what };
        }
        Err(refused)
    }

    /// The cage's polygons. A quad stays one where both ways to split it are valid.
    fn faces(&self, scaffold: &tubes::Scaffold, vertices: &[Point]) -> Polygons {
        let triangles = scaffold.triangles();
        if self.options.triangles {
            return Polygons::from_triangles(&triangles);
        }
        let tree = Bvh::new(&self.skin.original, &self.skin.triangles);
        let clear = 0.5 * self.options.inflation.clearance * self.skin.space.size;
        let mut faces = Polygons::default();
        // Quads that are kept may be split either way, all at once.
        let mut possible = triangles.clone();
        for polygon in &scaffold.polygons {
            let pieces = tubes::split(&scaffold.corners, polygon);
            let whole = pieces.len() == 2
                && verify::splits_either_way(
                    &pieces,
                    vertices,
                    &possible,
                    (&self.skin.original, &self.skin.triangles),
                    (&tree, clear),
                );
            if whole {
                // Starts where a fan gives the verified triangles.
                let [a, b, c] = pieces[0];
                possible.extend([[b, c, pieces[1][2]], [b, pieces[1][2], a]]);
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
#[derive(Clone)]
pub(super) struct Clock {
    last: Instant,
    laps: Laps,
}

impl Clock {
    pub(super) fn new() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    pub(super) fn lap(&mut self, stage: &'static str) {
        let now = Instant::now();
        self.laps.push((stage, (now - self.last).as_secs_f64()));
        self.last = now;
    }
}
