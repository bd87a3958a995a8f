//! Inflation: the skin grows back from its thread, the cage gives way and never crosses anything.
//!
//! In the spirit of nested cages [SVJ15], with the means of [IPC]: skin and cage move together, as far
//! as additive continuous collision detection lets every gap stay open; then the cage relaxes by
//! Newton steps under a barrier. What presses it on the resting skin afterwards is in `tightening`. Cost:
//! about a hundred steps, each linear in the gaps narrower than a few per cent of the size.

use super::contacts::{contacts, narrower, split_otherwise, Body, Contact, Points};
use super::contraction::Start;
use super::energy::{energy, newton_step, stations, Shape, Station, Weights};
use super::obstacle::{Mesh, StandIn};
use super::report::least_angle;
use super::tubes::Scaffold;
use crate::geometry::collision::free_part;
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use rayon::prelude::*;

/// Limits of inflation; lengths relative to the bounding diagonal of the skin.
#[derive(Debug, Clone, Copy)]
pub struct InflationOptions {
    /// Gaps narrower than this push, to begin with.
    pub reach: f64,
    /// Gaps end at least this wide.
    pub clearance: f64,
    /// Strength of the final pressure; 0 leaves the cage as it grew.
    pub tightness: f64,
    /// Rounds of the final tightening; more, while the volume falls.
    pub rounds: usize,
}

impl Default for InflationOptions {
    fn default() -> Self {
        Self { reach: 4e-3, clearance: 3e-4, tightness: 1.0, rounds: 150 }
    }
}

/// The farthest anything moves in one step.
pub(super) const STEP: f64 = 3e-3;

/// Gaps narrower than this part of the reach make the skin wait, so many times in a row.
const PRESSED: f64 = 0.02;
const WAITS: usize = 4;

/// Rounds in which an edited cage goes to its new sections.
const APPROACH: usize = 60;

/// Rounds in which a section that goes comes to lie straight between its neighbours, and what is straight.
const STRAIGHTEN: usize = 100;
const STRAIGHT: f64 = 1e-3;

/// Weight against flat triangles while the cage is tightened.
pub(super) const QUALITY: f64 = 1e-4;
/// Weight against sections that slide along their limbs.
const SLIDE: f64 = 0.1;

/// A cage in the middle of its growth.
pub(crate) struct Inflation<'a> {
    scaffold: &'a Scaffold,
    pub(super) faces: Vec<[u32; 3]>,
    /// Triangles that quads may also be split into.
    others: Vec<[u32; 3]>,
    edges: Vec<(u32, u32)>,
    mirror: Option<&'a [u32]>,
    /// Whether a vertex moves; empty: all do.
    moves: Vec<bool>,
    /// Where along their limbs sections are to stay.
    sections: Vec<Station>,
    pub(crate) cage: Vec<Point>,
    body: Body,
}

/// Where growth came to a halt: a cage vertex.
pub(crate) struct Halt {
    pub(crate) vertex: usize,
}

impl<'a> Inflation<'a> {
    pub(crate) fn new(scaffold: &'a Scaffold, mirror: Option<&'a [u32]>, cage: Vec<Point>) -> Self {
        let faces = scaffold.triangles();
        let mut edges: Vec<(u32, u32)> = faces
            .iter()
            .flat_map(|t| [0, 1, 2].map(|k| (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]))))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let body = Body::new(&cage, &faces);
        Self {
            scaffold,
            faces,
            others: Vec::new(),
            edges,
            mirror,
            moves: Vec::new(),
            sections: stations(scaffold, &scaffold.corners),
            cage,
            body,
        }
    }

    /// Quads stay free whichever way they are split.
    pub(crate) fn keep_quads(mut self, quads: &[[u32; 4]]) -> Self {
        self.body = Body::with_quads(&self.cage, &self.faces, quads);
        self.others = split_otherwise(quads);
        self
    }

    /// Only these vertices move from now on.
    pub(crate) fn hold(mut self, moves: Vec<bool>) -> Self {
        self.body.hold(|v| moves[v as usize]);
        self.moves = moves;
        self
    }

    /// Grows from `start` around its obstacle at rest, to a gap of `least`.
    pub(crate) fn grow(
        &mut self,
        start: Start,
        options: &InflationOptions,
        least: f64,
        progress: &Part,
    ) -> Result<Result<(), Halt>, Cancelled> {
        let mut obstacle = start.obstacle;
        let (rest, triangles) = (&start.rest.points, &start.rest.triangles);
        let mut body = Body::new(&obstacle, triangles);
        let ways: Vec<Point> = rest.iter().zip(&obstacle).map(|(p, q)| p - q).collect();
        let far = ways.iter().map(|w| w.norm()).fold(1e-12, f64::max);
        let target = |t: f64| self.scaffold.grown(t);
        let mut weights = Weights {
            shape: 1.0,
            anchor: 0.02,
            slide: 0.0,
            volume: 0.0,
            quality: 2e-5,
            reach: options.reach,
            least: 0.0,
        };
        let (mut t, mut stalled, mut softened, mut waited) = (0.0_f64, 0, 0, 0);
        let mut goal = target(0.0);
        for _ in 0..1500 {
            progress.reach(t)?;
            let dt = (STEP / far).min(1.0 - t);
            let wanted = target(t + dt);
            let mut moves: Vec<Point> = wanted.iter().zip(&goal).map(|(p, q)| p - q).collect();
            let longest = moves.iter().map(|m| m.norm()).fold(1e-300, f64::max);
            moves.iter_mut().for_each(|m| *m *= (STEP / longest).min(1.0));
            self.body.tree.refit(&self.cage);
            body.tree.refit(&obstacle);
            let mut around = Surroundings::of(
                &self.body,
                &body,
                &self.cage,
                &obstacle,
                weights.reach + least + 4.0 * STEP,
            );
            let narrowest = around.narrowest();
            // While it grows, half of every gap is free to be used.
            let wished = if t < 1.0 { 0.5 * narrowest } else { 0.5 * (narrowest + weights.least) };
            weights.least = least.min(wished.max(weights.least));
            // A barrier pushes a gap open by a few times its width: the skin waits for a cage that is pressed.
            let pressed = narrowest - weights.least < PRESSED * weights.reach && waited < WAITS;
            waited = if pressed { waited + 1 } else { 0 };
            let dt = if pressed { 0.0 } else { dt };
            let steps: Vec<Point> = ways.iter().map(|w| w * dt).collect();
            let points = Points { cage: &self.cage, obstacle: &obstacle };
            let mut part = around.free(&points, Some(&moves), Some(&steps), weights.least);
            if part < 0.05 {
                // The cage's own way may be what blocks: it stays then.
                moves.iter_mut().for_each(|m| *m = Point::zeros());
                part = around.free(&points, None, Some(&steps), weights.least);
            }
            around.moved += part * relative(Some(&moves), Some(&steps));
            self.cage.iter_mut().zip(&moves).for_each(|(p, m)| *p += m * part);
            obstacle.iter_mut().zip(&steps).for_each(|(p, m)| *p += m * part);
            t += dt * part;
            if 1.0 - t < 1e-12 {
                t = 1.0;
                obstacle.copy_from_slice(rest);
            }
            goal = target(t);
            // Where shape and skin can't agree, the cage yields: its present shape is the rest shape.
            let rest_shape = if softened > 0 { self.cage.clone() } else { goal.clone() };
            self.relax(&mut around, &obstacle, &rest_shape, &weights, (if pressed { 6 } else { 3 }, STEP));
            if t >= 1.0 && weights.least >= 0.999 * least {
                return Ok(Ok(()));
            }
            let slow = if t >= 1.0 {
                weights.least < 0.5 * least && narrowest < 2.0 * weights.least
            } else {
                !pressed && part * dt * far < 1e-3 * STEP
            };
            stalled = if slow { stalled + 1 } else { 0 };
            if stalled > 12 {
                if softened < 2 {
                    softened += 1;
                    stalled = 0;
                    weights.shape *= 0.2;
                    weights.anchor *= 0.2;
                    weights.reach *= 0.6;
                    continue;
                }
                return Ok(Err(self.halt(&obstacle, &around.found)));
            }
        }
        Ok(Err(self.halt(&obstacle, &[])))
    }

    fn halt(&self, obstacle: &[Point], found: &[Contact]) -> Halt {
        let points = Points { cage: &self.cage, obstacle };
        let narrow = found.iter().min_by(|a, b| points.width(a).total_cmp(&points.width(b)));
        let own = narrow.and_then(|c| c.at.into_iter().find(|v| (*v as usize) < self.cage.len()));
        Halt { vertex: own.unwrap_or(0) as usize }
    }

    /// Brings the cage toward `goal` around a resting obstacle, as far as gaps allow.
    pub(crate) fn approach(
        &mut self,
        goal: &[Point],
        obstacle: &StandIn,
        options: &InflationOptions,
        progress: &Part,
    ) -> Result<(), Cancelled> {
        self.sections = stations(self.scaffold, goal);
        let mut resting = Resting::new(obstacle, options);
        for round in 0..APPROACH {
            progress.reach(round as f64 / APPROACH as f64)?;
            let weights = Weights {
                volume: 0.0,
                slide: 0.0,
                anchor: 0.02,
                ..resting.weights(options, (options.reach, 1.0, QUALITY))
            };
            if self.press(&mut resting, Some(goal), weights, STEP) < 0.02 * STEP {
                break;
            }
        }
        Ok(())
    }

    /// Brings vertices to the middle of two others, which give way.
    pub(crate) fn straighten(
        &mut self,
        links: &[(u32, [u32; 2])],
        obstacle: &StandIn,
        options: &InflationOptions,
        progress: &Part,
    ) -> Result<(), Cancelled> {
        let mut resting = Resting::new(obstacle, options);
        for _ in 0..STRAIGHTEN {
            progress.check()?;
            let mut goal = self.cage.clone();
            for (v, ends) in links {
                let [a, b] = ends.map(|end| self.cage[end as usize]);
                let along = b - a;
                let t = ((self.cage[*v as usize] - a).dot(&along) / along.norm_squared().max(1e-300))
                    .clamp(0.1, 0.9);
                goal[*v as usize] = a + along * t;
            }
            let farthest = goal.iter().zip(&self.cage).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max);
            if farthest < STRAIGHT {
                break;
            }
            let weights = resting.weights(options, (options.reach, 1.0, QUALITY));
            let weights = Weights { volume: 0.0, slide: 0.0, ..weights };
            self.press(&mut resting, Some(&goal), weights, STEP);
        }
        Ok(())
    }

    /// One round around a resting obstacle, from where it is or toward a goal: no longer than `limit`.
    /// How far anything moved.
    pub(super) fn press(
        &mut self,
        resting: &mut Resting,
        goal: Option<&[Point]>,
        mut weights: Weights,
        limit: f64,
    ) -> f64 {
        self.body.tree.refit(&self.cage);
        let (clearance, points) = (resting.clearance, resting.points);
        let reached = weights.reach + clearance + 2.0 * limit;
        let mut around = Surroundings::of(&self.body, &resting.body, &self.cage, points, reached);
        // A gap that is too narrow may become wider, never narrower than it was allowed to be.
        resting.least = clearance.min((0.5 * around.narrowest()).max(resting.least));
        weights.least = resting.least;
        let here = goal.map_or_else(|| self.cage.clone(), <[Point]>::to_vec);
        self.relax(&mut around, points, &here, &weights, (2, limit))
    }

    /// Of all corners of faces that move, degrees.
    pub(crate) fn least_angle(&self) -> f64 {
        let moves = |t: &&[u32; 3]| t.iter().any(|v| self.moves.get(*v as usize) != Some(&false));
        let angle = |t: &[u32; 3]| least_angle(t.map(|v| self.cage[v as usize]));
        self.faces.iter().chain(&self.others).filter(moves).map(angle).fold(180.0, f64::min)
    }

    /// Some Newton steps toward `goal`, together no longer than `limit`. How far anything moved.
    fn relax(
        &mut self,
        around: &mut Surroundings,
        obstacle: &[Point],
        goal: &[Point],
        weights: &Weights,
        (rounds, limit): (usize, f64),
    ) -> f64 {
        let edges = std::mem::take(&mut self.edges);
        let sections = std::mem::take(&mut self.sections);
        let (mirror, moves) = (self.mirror, &self.moves);
        let (faces, others) = (&self.faces[..], &self.others[..]);
        let shape = Shape { faces, others, edges: &edges, rest: goal, mirror, moves, sections: &sections };
        let mut left = limit;
        for _ in 0..rounds {
            let points = Points { cage: &self.cage, obstacle };
            let found = around.within(weights.least + weights.reach + 2.0 * left);
            let mut step = newton_step(&shape, &points, found, weights);
            let longest = step.iter().map(|s| s.norm()).fold(1e-300, f64::max);
            if !longest.is_finite() || left < 1e-6 {
                break;
            }
            step.iter_mut().for_each(|s| *s *= (left / longest).min(1.0));
            let longest = longest.min(left);
            let mut part = around.free(&points, Some(&step), None, weights.least);
            let before = energy(&shape, &points, found, weights);
            let mut moved = None;
            for _ in 0..10 {
                let next: Vec<Point> = self.cage.iter().zip(&step).map(|(p, s)| p + s * part).collect();
                if energy(&shape, &Points { cage: &next, obstacle }, found, weights) < before {
                    moved = Some(next);
                    break;
                }
                part *= 0.5;
            }
            let Some(next) = moved else { break };
            self.cage = next;
            around.moved += 2.0 * part * longest;
            left -= part * longest;
            if part * longest < 1e-3 * weights.reach {
                break;
            }
        }
        self.edges = edges;
        self.sections = sections;
        limit - left
    }
}

/// An obstacle that stays where it is while the cage is tightened around it.
pub(super) struct Resting<'a> {
    points: &'a [Point],
    body: Body,
    /// Wanted in every gap.
    clearance: f64,
    /// What no gap falls below.
    least: f64,
}

impl<'a> Resting<'a> {
    pub(super) fn new(obstacle: &'a StandIn, options: &InflationOptions) -> Self {
        let Mesh { points, triangles } = &obstacle.mesh;
        let body = Body::new(points, triangles);
        Self { points, body, clearance: options.clearance + obstacle.margin, least: 0.0 }
    }

    pub(super) fn weights(
        &self,
        options: &InflationOptions,
        (reach, shape, quality): (f64, f64, f64),
    ) -> Weights {
        let (volume, least) = (options.tightness, self.least);
        Weights { shape, anchor: 1e-3, slide: SLIDE, volume, quality, reach, least }
    }
}

/// The gaps around the cage, the narrowest first, and how far things have moved toward each other
/// since they were found.
struct Surroundings {
    found: Vec<Contact>,
    moved: f64,
}

impl Surroundings {
    /// Of bodies fitted to `cage` and `obstacle`: every gap narrower than `reach`.
    fn of(body: &Body, other: &Body, cage: &[Point], obstacle: &[Point], reach: f64) -> Self {
        Self { found: contacts(body, other, &Points { cage, obstacle }, reach), moved: 0.0 }
    }

    /// When they were found.
    fn narrowest(&self) -> f64 {
        self.found.first().map_or(f64::INFINITY, |c| c.width)
    }

    /// All that may be narrower than `limit` by now.
    fn within(&self, limit: f64) -> &[Contact] {
        narrower(&self.found, limit + self.moved)
    }

    /// The part of the moves after which every gap is open.
    fn free(&self, points: &Points, cage: Option<&[Point]>, obstacle: Option<&[Point]>, least: f64) -> f64 {
        let n = points.cage.len();
        let way = |v: u32| {
            let v = v as usize;
            let moves = if v < n { cage.and_then(|m| m.get(v)) } else { obstacle.and_then(|m| m.get(v - n)) };
            moves.copied().unwrap_or_else(Point::zeros)
        };
        let part = |c: &Contact| free_part(c.gap, &points.of(c), &c.at.map(way), least);
        let near = self.within(least + 1.3 * relative(cage, obstacle));
        near.par_iter().with_min_len(256).map(part).reduce(|| 1.0, f64::min)
    }
}

/// No gap narrows by more than this.
fn relative(cage: Option<&[Point]>, obstacle: Option<&[Point]>) -> f64 {
    let longest = |moves: Option<&[Point]>| moves.unwrap_or(&[]).iter().map(|m| m.norm()).fold(0.0, f64::max);
    let cage = longest(cage);
    cage + cage.max(longest(obstacle))
}
