//! Control nodes: where the cage gets a cross section.
//!
//! Bending nodes are the user's, or placed: the first of each arc where it leaves the lump around
//! its branching node (no sibling is seen any more), then either where position and radius of the
//! inscribed ball leave their linear course ([CLM*19] §4: abrupt changes of the radius), or at the
//! joints. Leaf nodes are pulled inward, or pushed on, until their radius is 0.3 of the arc's.

use super::skeleton::{climb, Arc, CurveSkeleton};
use super::skin::Skin;
use super::symmetry::image;
use super::tips::THIN;
use crate::error::CagingError;
use crate::points::{first_unusable, Point};

/// Nodes at joints, and others, are so far apart, in radii of the inscribed ball.
const CLOSE: f64 = 0.9;
const APART: f64 = 1.2;
/// A bend leaves the chord by so many radii. Tessellations of one character differ by a third of one:
/// where less counted, they would get other cages. A limb without any node takes slighter bends.
const BEND: f64 = 0.51;
const SLIGHT: f64 = 0.35;
/// On a stretch longer than so many radii slighter ones count, as they leave more between cage and skin.
const LONG: f64 = 10.0;

/// How bending nodes are placed where the user gives none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Placement {
    /// Where the radius of the inscribed ball or the direction changes.
    #[default]
    Automatic,
    /// At the nodes of the skeleton.
    Joints,
}

/// What a control node is on its arc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodeKind {
    /// Between two others.
    Bending,
    /// At the end of an arc.
    Leaf,
}

/// A place on the skeleton that gets a cross section. Unit space.
#[derive(Debug, Clone)]
pub(crate) struct ControlNode {
    pub(crate) kind: NodeKind,
    pub(crate) arc: usize,
    /// On the arc.
    pub(crate) place: Point,
    /// Beside it, in the middle of the skin.
    pub(crate) point: Point,
    /// Along the arc, from its first end to its second.
    pub(crate) direction: Point,
    /// Radius of the inscribed ball.
    pub(crate) radius: f64,
    /// The nearest node of the input.
    pub(crate) node: usize,
}

/// Control nodes, arc after arc, in order along each. `bending`: the user's, anywhere near the
/// skeleton.
pub(crate) fn control_nodes(
    skin: &Skin,
    skeleton: &CurveSkeleton,
    bending: Option<&[Point]>,
    placement: Placement,
) -> Result<Vec<ControlNode>, CagingError> {
    let mut given = vec![Vec::new(); skeleton.arcs.len()];
    if let Some(bending) = bending {
        if let Some(row) = first_unusable(bending) {
            return Err(CagingError::BendingNotFinite { row });
        }
        for p in bending {
            let p = skin.space.enter(p);
            let nearest = skeleton.arcs.iter().map(|arc| arc.nearest(&p)).enumerate();
            if let Some((arc, (_, s))) = nearest.min_by(|a, b| a.1 .0.total_cmp(&b.1 .0)) {
                given[arc].push(s);
            }
        }
    }
    if bending.is_none() {
        for (at, arc) in skeleton.arcs.iter().enumerate() {
            given[at] = placed(skin, skeleton, at, placement);
            if skin.symmetric {
                given[at] = even(arc, std::mem::take(&mut given[at]));
            }
        }
    }
    on_arcs(skin, skeleton, given)
}

/// Control nodes at places along each arc, and at leaves.
pub(crate) fn on_arcs(
    skin: &Skin,
    skeleton: &CurveSkeleton,
    places: Vec<Vec<f64>>,
) -> Result<Vec<ControlNode>, CagingError> {
    let mut nodes = Vec::new();
    for (at, (arc, mut places)) in skeleton.arcs.iter().zip(places).enumerate() {
        let leaf = arc.ends.map(|e| skeleton.junctions[e].degree == 1);
        places.sort_by(f64::total_cmp);
        if places.is_empty() && !leaf[0] && !leaf[1] {
            places.push(arc.length() * 0.5);
        }
        if leaf[0] {
            nodes.push(leaf_node(skin, arc, at, 0, places.first().copied()));
        }
        nodes.extend(places.iter().map(|s| bending_node(skin, arc, at, *s)));
        if leaf[1] {
            nodes.push(leaf_node(skin, arc, at, 1, places.last().copied()));
        }
    }
    if nodes.len() < 2 {
        return Err(CagingError::TooFewSections { sections: nodes.len() });
    }
    Ok(nodes)
}

fn nearest_node(arc: &Arc, s: f64) -> usize {
    let named = arc.along.iter().zip(&arc.nodes).filter_map(|(a, n)| n.map(|n| ((a - s).abs(), n)));
    named.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, n)| n)
}

fn bending_node(skin: &Skin, arc: &Arc, at: usize, s: f64) -> ControlNode {
    let radius = arc.radius_at(s);
    let direction = arc.direction(s, radius.min(0.25 * arc.length()));
    let place = arc.at(s);
    let point = climb(skin, place, Some(direction));
    let radius = skin.depth(&point).max(1e-3);
    let node = nearest_node(arc, s);
    ControlNode { kind: NodeKind::Bending, arc: at, place, point, direction, radius, node }
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Pulled inward from the tip until its radius is 0.3 of the arc's.
fn leaf_node(skin: &Skin, arc: &Arc, at: usize, side: usize, neighbour: Option<f64>) -> ControlNode {
    let length = arc.length();
    let from_tip = |d: f64| if side == 0 { d } else { length - d };
    let wanted = THIN * median(arc.radii.clone());
    // Not past half the way to the neighbour.
    let room = neighbour.map_or(length, |n| (from_tip(0.0) - n).abs()) * 0.5;
    let steps = 40;
    let found = (0..=steps)
        .map(|k| room * f64::from(k) / f64::from(steps))
        .find(|d| arc.radius_at(from_tip(*d)) >= wanted);
    let s = from_tip(found.unwrap_or(room));
    let direction = arc.direction(s, 0.1 * length);
    let place = arc.at(s);
    let point = climb(skin, place, Some(direction));
    let radius = skin.depth(&point).max(1e-3);
    let node = nearest_node(arc, from_tip(0.0));
    ControlNode { kind: NodeKind::Leaf, arc: at, place, point, direction, radius, node }
}

/// Places on an arc that crosses the plane of symmetry and is its own image: those of its first half,
/// and their images.
fn even(arc: &Arc, places: Vec<f64>) -> Vec<f64> {
    let length = arc.length();
    let is_own_image = (0..=8).all(|k| {
        let s = length * f64::from(k) / 8.0;
        (image(&arc.at(s)) - arc.at(length - s)).norm() < 1e-6
    });
    if !is_own_image || arc.at(0.0).x.abs() < 1e-6 {
        return places;
    }
    let gap = 0.45 * arc.radius_at(0.5 * length);
    let half: Vec<f64> = places.iter().copied().filter(|s| *s < 0.5 * length - gap).collect();
    let middle = places.iter().any(|s| (s - 0.5 * length).abs() <= gap).then_some(0.5 * length);
    half.iter().copied().chain(middle).chain(half.iter().map(|s| length - s)).collect()
}

/// Bending nodes of an arc without the user.
fn placed(skin: &Skin, skeleton: &CurveSkeleton, at: usize, placement: Placement) -> Vec<f64> {
    let arc = &skeleton.arcs[at];
    let length = arc.length();
    let is_leaf = |side: usize| skeleton.junctions[arc.ends[side]].degree == 1;
    let mut from = if is_leaf(0) { 0.0 } else { leaves_lump(skin, skeleton, at, 0) };
    let mut to = length - if is_leaf(1) { 0.0 } else { leaves_lump(skin, skeleton, at, 1) };
    let apart = if placement == Placement::Joints { CLOSE } else { APART };
    let gap = |s: f64| apart * arc.radius_at(s);
    if to - from < gap(0.5 * (from + to)) {
        let both = !is_leaf(0) && !is_leaf(1);
        return if both { vec![(0.5 * (from + to)).clamp(0.1 * length, 0.9 * length)] } else { Vec::new() };
    }
    let mut places = Vec::new();
    if !is_leaf(0) {
        places.push(from);
    }
    if !is_leaf(1) {
        places.push(to);
    }
    // Leaf ends: nothing within the rounding of the tip.
    from += if is_leaf(0) { 0.6 * median(arc.radii.clone()) } else { 0.0 };
    to -= if is_leaf(1) { 0.6 * median(arc.radii.clone()) } else { 0.0 };
    let mut wanted = match placement {
        Placement::Joints => {
            let inner = 1..arc.path.len().saturating_sub(1);
            inner.filter(|k| arc.nodes[*k].is_some()).map(|k| arc.along[k]).collect()
        }
        Placement::Automatic => {
            let mut found = Vec::new();
            let bend = if places.is_empty() { SLIGHT } else { BEND };
            bends(arc, (from.max(0.0), to.min(length)), bend, 0, &mut found);
            found
        }
    };
    wanted.sort_by(f64::total_cmp);
    for s in wanted {
        let free = places.iter().all(|p: &f64| (p - s).abs() > gap(s).max(gap(*p)));
        if s > from && s < to && free {
            places.push(s);
        }
    }
    places
}

/// Where the course of position and radius leaves the chord from `a` to `b` by so many radii; by less on a long way.
fn bends(arc: &Arc, (a, b): (f64, f64), bend: f64, depth: usize, found: &mut Vec<f64>) {
    let value = |s: f64| {
        let p = arc.at(s);
        [p.x, p.y, p.z, 0.7 * arc.radius_at(s)]
    };
    let (from, to) = (value(a), value(b));
    let miss = |s: f64| {
        let (t, v) = ((s - a) / (b - a), value(s));
        (0..4).map(|k| (v[k] - from[k] - t * (to[k] - from[k])).powi(2)).sum::<f64>().sqrt()
    };
    let samples = (1..32).map(|k| a + (b - a) * f64::from(k) / 32.0);
    let Some(worst) = samples.max_by(|s, t| miss(*s).total_cmp(&miss(*t))) else { return };
    let radius = median(arc.radii.clone());
    let least = bend * radius * (LONG * radius / (b - a)).min(1.0);
    if depth < 4 && b - a > 1.5 * arc.radius_at(worst) && miss(worst) > least {
        found.push(worst);
        bends(arc, (a, worst), bend, depth + 1, found);
        bends(arc, (worst, b), bend, depth + 1, found);
    }
}

/// How far from a branching end the arc is on its own: siblings at the same distance that lie ahead
/// are no longer seen.
fn leaves_lump(skin: &Skin, skeleton: &CurveSkeleton, at: usize, side: usize) -> f64 {
    let end = skeleton.arcs[at].ends[side];
    let center = skeleton.junctions[end].point;
    let place = |arc: &Arc, side: usize, d: f64| arc.at(if side == 0 { d } else { arc.length() - d });
    let length = skeleton.arcs[at].length();
    let mut siblings = Vec::new();
    for (k, arc) in skeleton.arcs.iter().enumerate() {
        for other in 0..2 {
            if arc.ends[other] == end && (k, other) != (at, side) {
                siblings.push((k, other));
            }
        }
    }
    let whole = !skeleton.arcs[at].ends.iter().any(|e| skeleton.junctions[*e].degree == 1);
    let limit = length * if whole { 0.7 } else { 0.85 };
    let least = (0.7 * skeleton.junctions[end].radius).min(0.5 * limit);
    let own = |d: f64| {
        let p = place(&skeleton.arcs[at], side, d);
        siblings.iter().all(|(k, other)| {
            let arc = &skeleton.arcs[*k];
            let q = place(arc, *other, d.min(0.9 * arc.length()));
            let (u, v) = (p - center, q - center);
            u.dot(&v) < 0.1 * u.norm() * v.norm() || !skin.sees(&p, &q, 40)
        })
    };
    let steps = 60;
    let places = (0..=steps).map(|k| least + (limit - least) * f64::from(k) / f64::from(steps));
    let found = places.into_iter().find(|d| own(*d));
    found.map_or(least, |d| {
        (d + 0.15 * skeleton.arcs[at].radius_at(if side == 0 { d } else { length - d })).min(limit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::skeleton::curve_skeleton;
    use crate::fixtures::shapes::square_tube;

    #[test]
    fn a_slight_bulge_gets_a_node_on_a_long_limb_alone() {
        for (length, count) in [(10, 2), (30, 3)] {
            let radius = |x: f64| 1.0 + 0.5 * (std::f64::consts::PI * x / f64::from(length)).sin();
            let rings: Vec<(f64, f64)> = (0..=length).map(f64::from).map(|x| (x, radius(x))).collect();
            let (vertices, faces) = square_tube(&rings);
            let skin = Skin::new(&vertices, &faces).expect("closed");
            let bones = [1.0, f64::from(length) - 1.0].map(|x| Point::new(x, 0.0, 0.0));
            let skeleton = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
            let nodes = control_nodes(&skin, &skeleton, None, Placement::Automatic).expect("two");
            assert_eq!(nodes.len(), count, "{length}");
        }
    }
}
