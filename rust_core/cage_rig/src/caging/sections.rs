//! Cross sections: field lines from a small circle out to the skin, and a quad of their ends.
//!
//! [CLM*19] §5–6. Twenty seeds on a circle around the control node follow the gradient of its
//! [`Field`]; the ring of ends is looked at in its principal axes. The paper takes, for each
//! quadrant, the extreme ring point, and can take one twice (at toes); here the four are distinct, in
//! cyclic order and spaced, chosen together. A window costs about 20 ms; windows run in parallel.

use super::control_nodes::{ControlNode, NodeKind};
use super::field::{self, Field};
use super::skeleton::CurveSkeleton;
use super::skin::Skin;
use crate::error::CagingError;
use crate::points::{Matrix3, Point};
use crate::progress::Part;
use rayon::prelude::*;
use std::collections::hash_map::DefaultHasher;
use std::collections::HashMap;
use std::hash::{Hash, Hasher};
use std::sync::{Mutex, PoisonError};

/// Seeds on the circle.
const SEEDS: usize = 20;
/// Least mean half width of a leaf's section, in radii of its ball (which is 0.3 of the arc's).
const BLUNT: f64 = 2.2;

/// Neighbouring corners are so far apart, in radii of the inscribed ball: field lines draw together at a nose.
const DISTINCT: f64 = 0.25;

/// How finely sections are looked for.
#[derive(Debug, Clone, Copy)]
pub struct SectionOptions {
    /// Cells a side of a window; 48.
    pub grid: usize,
    /// Corners of a section, 3 to 8; 4 as in the paper.
    pub corners: usize,
}

impl Default for SectionOptions {
    fn default() -> Self {
        Self { grid: 48, corners: 4 }
    }
}

/// The cross section of one control node. Unit space.
#[derive(Debug, Clone)]
pub(crate) struct Section {
    /// Where field lines meet the skin, counterclockwise about the arc's direction.
    pub(crate) ring: Vec<Point>,
    /// The chosen corners, in the same order.
    pub(crate) corners: Vec<Point>,
    pub(crate) center: Point,
}

/// The sections traced so far, by what they depend on.
#[derive(Debug, Default)]
pub(crate) struct Traced(Mutex<HashMap<u64, Section>>);

impl Traced {
    /// One section for each control node. With `partners` (of a symmetric skin), only the first of two
    /// mirrored nodes has its own; that of the second is a copy to be replaced by the image.
    pub(crate) fn sections(
        &self,
        skin: &Skin,
        skeleton: &CurveSkeleton,
        nodes: &[ControlNode],
        (options, partners): (&SectionOptions, Option<&[usize]>),
        part: &Part,
    ) -> Result<Vec<Section>, CagingError> {
        let count = part.count(nodes.len());
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let of_node = |(at, node): (usize, &ControlNode)| {
            if partners.is_some_and(|partners| partners[at] < at) {
                return Ok(None);
            }
            let key = key(skeleton, node);
            let kept = lock().get(&key).cloned();
            let found = kept.or_else(|| section(skin, skeleton, node, options));
            count.step(1)?;
            let found = found
                .ok_or(CagingError::NoSection { node: node.node, place: skin.space.leave(&node.point) })?;
            lock().insert(key, found.clone());
            Ok(Some(found))
        };
        let found: Vec<Option<Section>> =
            nodes.par_iter().enumerate().map(of_node).collect::<Result<_, CagingError>>()?;
        let own = |at: usize| found[at].clone().or_else(|| found[partners?[at]].clone());
        Ok((0..nodes.len()).filter_map(own).collect())
    }

    #[cfg(test)]
    fn len(&self) -> usize {
        self.0.lock().map_or(0, |kept| kept.len())
    }
}

/// Of the node and of the skeleton within its window.
fn key(skeleton: &CurveSkeleton, node: &ControlNode) -> u64 {
    let mut hasher = DefaultHasher::new();
    let mut add = |p: &Point, r: f64| [p.x, p.y, p.z, r].iter().for_each(|x| x.to_bits().hash(&mut hasher));
    add(&node.point, node.radius);
    add(&node.direction, if node.kind == NodeKind::Leaf { 1.0 } else { 0.0 });
    for (a, b, radii) in field::near(skeleton, &node.point, node.radius) {
        add(&a, radii[0]);
        add(&b, radii[1]);
    }
    hasher.finish()
}

/// The section of one node; `None` where the field lines don't reach the skin around it.
pub(crate) fn section(
    skin: &Skin,
    skeleton: &CurveSkeleton,
    node: &ControlNode,
    options: &SectionOptions,
) -> Option<Section> {
    let field = Field::new(skin, skeleton, &node.point, node.radius, options.grid);
    let (u, v) = frame(&node.direction);
    let start = (0.2 * node.radius).max(1.3 * field.spacing);
    let ring: Vec<Point> = (0..SEEDS)
        .filter_map(|k| {
            let angle = (k as f64 + 0.5) * std::f64::consts::TAU / SEEDS as f64;
            let out = u * angle.cos() + v * angle.sin();
            trace(skin, &field, node.point + out * start.min(0.5 * node.radius), out)
        })
        .collect();
    if ring.len() < SEEDS / 2 {
        return None;
    }
    let corners = corners(&ring, node, options.corners);
    let mut found = Section { ring, corners, center: Point::zeros() };
    found.widen(node);
    Some(found)
}

impl Section {
    /// Its middle from its corners. Field lines close to a blunt end meet in its middle; the cage wants its
    /// width.
    pub(super) fn widen(&mut self, node: &ControlNode) {
        let Self { corners, center, .. } = self;
        *center = corners.iter().sum::<Point>() / corners.len() as f64;
        if node.kind == NodeKind::Leaf {
            let width = corners.iter().map(|p| (p - *center).norm()).sum::<f64>() / corners.len() as f64;
            let scale = (BLUNT * node.radius / width.max(1e-300)).clamp(1.0, 5.0);
            corners.iter_mut().for_each(|p| *p = *center + (*p - *center) * scale);
        }
    }
}

/// Two axes at right angles to `direction` and each other, counterclockwise.
pub(crate) fn frame(direction: &Point) -> (Point, Point) {
    // The axis least along the direction; x first, so that mirrored nodes get mirrored seeds.
    let pick = (0..3).min_by(|a, b| direction[*a].abs().total_cmp(&direction[*b].abs())).unwrap_or(0);
    let pick = if direction.x.abs() < 0.5 { 0 } else { pick };
    let mut axis = Point::zeros();
    axis[pick] = 1.0;
    let v = direction.cross(&axis).normalize();
    (v.cross(direction), v)
}

/// Follows the gradient from `p` to the skin. A line that leaves the window goes on straight.
fn trace(skin: &Skin, field: &Field, mut p: Point, out: Point) -> Option<Point> {
    let mut way = out;
    let step = 0.3 * field.spacing;
    let direction = |p: &Point| field.gradient(p).and_then(|g| g.try_normalize(1e-9));
    for turn in 0..2000 {
        // Lines end at the skin; one that wanders in a flat field goes on straight.
        if turn == 400 {
            way = out;
        }
        if let Some(first) = direction(&p).filter(|_| turn < 400) {
            way = direction(&(p + first * (0.5 * step))).unwrap_or(first);
        }
        let next = p + way * step;
        if !skin.contains(&next) {
            let (mut inside, mut outside) = (p, next);
            for _ in 0..24 {
                let middle = (inside + outside) * 0.5;
                if skin.contains(&middle) {
                    inside = middle
                } else {
                    outside = middle
                }
            }
            return Some(outside);
        }
        p = next;
    }
    None
}

/// `count` corners of the ring, counterclockwise about the node's direction.
fn corners(ring: &[Point], node: &ControlNode, count: usize) -> Vec<Point> {
    let (axes, spread) = principal_axes(ring, &node.direction);
    let center = ring.iter().sum::<Point>() / ring.len() as f64;
    let flat: Vec<[f64; 2]> = ring
        .iter()
        .map(|p| [(p - center).dot(&axes[0]) / spread[0], (p - center).dot(&axes[1]) / spread[1]])
        .collect();
    let aims: Vec<[f64; 2]> = (0..count)
        .map(|k| {
            let angle = (k as f64 + 0.5) * std::f64::consts::TAU / count as f64;
            [angle.cos(), angle.sin()]
        })
        .collect();
    let score = |aim: usize, at: usize| aims[aim][0] * flat[at][0] + aims[aim][1] * flat[at][1];
    best(ring, count, DISTINCT * node.radius, &score)
}

/// The ring points nearest to `targets`, in their order around the ring.
pub(super) fn toward(ring: &[Point], targets: &[Point]) -> Vec<Point> {
    best(ring, targets.len(), 0.0, &|aim: usize, at: usize| -(ring[at] - targets[aim]).norm_squared())
}

/// Points of the ring in cyclic order, one for each aim, neighbours at least `apart` where there are such.
fn best(ring: &[Point], count: usize, apart: f64, score: &impl Fn(usize, usize) -> f64) -> Vec<Point> {
    // The best increasing choice with gaps of two, from each possible first ring point.
    let (n, gap) = (ring.len(), (ring.len() / (3 * count)).max(1));
    let next = |a: usize, b: usize| b - a >= gap && (ring[a % n] - ring[b % n]).norm() >= apart;
    let mut best = (f64::NEG_INFINITY, Vec::new());
    for first in 0..n {
        let (value, chosen) = choose(first, n, &next, count, score);
        if value > best.0 {
            best = (value, chosen);
        }
    }
    if best.1.is_empty() && apart > 0.0 {
        return self::best(ring, count, 0.0, score);
    }
    best.1.iter().map(|k| ring[*k % n]).collect()
}

/// The best places for aims 1.. after aim 0 at `first`, cyclic, each one that may be `next` to the one before.
fn choose(
    first: usize,
    n: usize,
    next: &impl Fn(usize, usize) -> bool,
    count: usize,
    score: &impl Fn(usize, usize) -> f64,
) -> (f64, Vec<usize>) {
    let mut table = vec![vec![(f64::NEG_INFINITY, 0); n]; count];
    table[0][0] = (score(0, first), 0);
    for aim in 1..count {
        for at in aim..n {
            let before = (0..at).filter(|k| next(first + k, first + at)).map(|k| (table[aim - 1][k].0, k));
            if let Some((value, k)) = before.max_by(|a, b| a.0.total_cmp(&b.0)) {
                table[aim][at] = (value + score(aim, (first + at) % n), k);
            }
        }
    }
    let ends = (0..n).filter(|at| next(first + at, first + n)).map(|at| (table[count - 1][at].0, at));
    let Some((value, mut at)) = ends.max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return (f64::NEG_INFINITY, Vec::new());
    };
    let mut chosen = vec![0; count];
    for aim in (0..count).rev() {
        chosen[aim] = first + at;
        at = table[aim][at].1;
    }
    (value, chosen)
}

/// The two principal axes of the ring, the second a quarter turn left of the first about
/// `direction`, and the spread along each.
fn principal_axes(ring: &[Point], direction: &Point) -> ([Point; 2], [f64; 2]) {
    let center = ring.iter().sum::<Point>() / ring.len() as f64;
    let (u, v) = frame(direction);
    let covariance: Matrix3 =
        ring.iter().map(|p| (p - center) * (p - center).transpose()).sum::<Matrix3>() / ring.len() as f64;
    // Within the plane across the arc: along the arc a section has no corners to choose.
    let (a, b, c) = (u.dot(&(covariance * u)), u.dot(&(covariance * v)), v.dot(&(covariance * v)));
    let angle = if (2.0 * b).hypot(a - c) < 0.05 * (a + c) { 0.0 } else { 0.5 * (2.0 * b).atan2(a - c) };
    let first = u * angle.cos() + v * angle.sin();
    let second = direction.cross(&first);
    let along = |axis: &Point| axis.dot(&(covariance * axis)).max(1e-300).sqrt();
    ([first, second], [along(&first), along(&second)])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::caging::control_nodes::{control_nodes, Placement};
    use crate::caging::skeleton::curve_skeleton;
    use crate::fixtures::shapes::{round_tube, square_tube};
    use crate::progress::Progress;

    pub(crate) fn unwatched_sections(
        traced: &Traced,
        skin: &Skin,
        skeleton: &CurveSkeleton,
        nodes: &[ControlNode],
        options: &SectionOptions,
    ) -> Vec<Section> {
        let progress = Progress::default();
        traced.sections(skin, skeleton, nodes, (options, None), &progress.whole()).expect("sections")
    }

    #[test]
    fn a_square_bar_has_sections_with_its_corners() {
        let rings: Vec<(f64, f64)> = (0..11).map(|i| (f64::from(i), 1.0)).collect();
        let (vertices, faces) = square_tube(&rings);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let bones = [Point::new(1.0, 0.0, 0.0), Point::new(9.0, 0.0, 0.0)];
        let skeleton = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
        let nodes = control_nodes(&skin, &skeleton, Some(&[Point::new(5.0, 0.3, 0.0)]), Placement::Joints);
        let nodes = nodes.expect("three");
        assert_eq!(nodes.len(), 3);
        let traced = Traced::default();
        let options = SectionOptions::default();
        let found = unwatched_sections(&traced, &skin, &skeleton, &nodes, &options);
        let middle: Vec<Point> = found[1].corners.iter().map(|p| skin.space.leave(p)).collect();
        for p in &middle {
            assert!((p.x - 5.0).abs() < 0.1, "{p}");
            assert!(p.y.abs() > 0.7 && p.z.abs() > 0.7 && p.y.abs().max(p.z.abs()) < 1.01, "{p}");
        }
        let turn = (middle[1] - middle[0]).cross(&(middle[2] - middle[0]));
        assert!(turn.x > 0.0);
    }

    #[test]
    fn corners_stay_apart_where_field_lines_draw_together() {
        // The two farthest points one way are all but one.
        let mut ring: Vec<Point> = (0..20)
            .map(|k| (f64::from(k) + 0.5) * std::f64::consts::TAU / 20.0)
            .map(|angle| Point::new(0.0, angle.cos(), angle.sin()))
            .collect();
        ring[4] = Point::new(0.0, 0.003, 3.0);
        ring[5] = Point::new(0.0, -0.003, 3.0);
        let node = ControlNode {
            kind: NodeKind::Bending,
            arc: 0,
            place: Point::zeros(),
            point: Point::zeros(),
            direction: Point::x(),
            radius: 1.0,
            node: 0,
        };
        let sides = |corners: &[Point]| {
            let side = |k: usize| (corners[k] - corners[(k + 1) % 4]).norm();
            (0..4).map(side).fold(f64::INFINITY, f64::min)
        };
        assert!(sides(&corners(&ring, &node, 4)) > DISTINCT);
        assert!(sides(&corners(&ring, &ControlNode { radius: 0.0, ..node }, 4)) < 0.1);
    }

    #[test]
    fn only_what_changed_is_traced_again() {
        let rings: Vec<(f64, f64)> = (0..11).map(|i| (f64::from(i), 1.0)).collect();
        let (vertices, faces) = square_tube(&rings);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let bones = [Point::new(1.0, 0.0, 0.0), Point::new(9.0, 0.0, 0.0)];
        let skeleton = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
        let traced = Traced::default();
        for (middle, count) in [(5.0, 4), (5.0, 4), (5.5, 5)] {
            let bending = [Point::new(3.0, 0.0, 0.0), Point::new(middle, 0.0, 0.0)];
            let nodes = control_nodes(&skin, &skeleton, Some(&bending), Placement::Joints).expect("four");
            unwatched_sections(&traced, &skin, &skeleton, &nodes, &SectionOptions::default());
            assert_eq!(traced.len(), count);
        }
    }

    #[test]
    fn a_round_bar_has_a_round_section() {
        let (vertices, faces) = round_tube(10.0, 1.0, 64);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let bones = [Point::new(1.0, 0.0, 0.0), Point::new(9.0, 0.0, 0.0)];
        let skeleton = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
        let nodes = control_nodes(&skin, &skeleton, Some(&[Point::new(5.0, 0.0, 0.0)]), Placement::Joints);
        let options = SectionOptions::default();
        let found = section(&skin, &skeleton, &nodes.expect("three")[1], &options).expect("a ring");
        let ring: Vec<Point> = found.ring.iter().map(|p| skin.space.leave(p)).collect();
        let middle = ring.iter().sum::<Point>() / ring.len() as f64;
        assert!((middle - Point::new(5.0, 0.0, 0.0)).norm() < 0.03, "{middle}");
        assert_eq!(ring.len(), SEEDS);
        let even = std::f64::consts::TAU / SEEDS as f64;
        for (k, p) in ring.iter().enumerate() {
            let (out, next) = (p - middle, ring[(k + 1) % SEEDS] - middle);
            assert!((out.norm() - 1.0).abs() < 0.03, "{p}");
            assert!(out.x.abs() < 0.05, "{p} is not in the plane across");
            // What the field is 0 on is a staircase of cells. Lines that start next to it draw together
            // at its flat sides; those that start four cells away, on a grid of 96, are even.
            assert!(out.angle(&next) < 2.0 * even, "{} between two lines", out.angle(&next));
        }
    }
}
