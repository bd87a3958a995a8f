//! What of a skeleton gets no branch of the cage.
//!
//! Leaves that don't stick out of the part they start from are removed, one after the other, and as a
//! whole what branches inside one lump, as the bones of a face do; branching nodes closer than their
//! radius are merged. Looks at pairs of leaves.

use super::skeleton::{join, Arc, CurveSkeleton, Graph};
use super::skin::Skin;
use super::symmetry::image;
use crate::points::Point;

/// Removes one leaf arc that does not stick out, with its mirror image on a symmetric skin. True when
/// there was one.
pub(super) fn prune(
    skin: &Skin,
    graph: &mut Graph,
    skeleton: &CurveSkeleton,
    (detail, without): (f64, &[usize]),
) -> bool {
    let mut leaves: Vec<(usize, usize, usize)> = Vec::new();
    for (k, arc) in skeleton.arcs.iter().enumerate() {
        for side in 0..2 {
            let (tip, base) = (arc.ends[side], arc.ends[1 - side]);
            if skeleton.junctions[tip].degree == 1 && skeleton.junctions[base].degree > 2 {
                leaves.push((k, tip, base));
            }
        }
    }
    let reach =
        |tip: usize, base: usize| (skeleton.junctions[tip].point - skeleton.junctions[base].point).norm();
    leaves.sort_by(|a, b| reach(a.1, a.2).total_cmp(&reach(b.1, b.2)).then(a.0.cmp(&b.0)));
    let hidden = |&(k, tip, base): &(usize, usize, usize)| {
        let (p, b) = (skeleton.junctions[tip].point, &skeleton.junctions[base]);
        let mut radii = skeleton.arcs[k].radii.clone();
        radii.sort_by(f64::total_cmp);
        let thin = radii[radii.len() / 2] < detail || without.contains(&skeleton.junctions[tip].node);
        let short = thin || reach(tip, base) < 1.4 * b.radius || skeleton.arcs[k].length() < 1e-2;
        let sibling = |&(other, far, at): &(usize, usize, usize)| {
            let q = skeleton.junctions[far].point;
            let ahead =
                (p - b.point).dot(&(q - b.point)) > -0.2 * (p - b.point).norm() * (q - b.point).norm();
            other != k && at == base && reach(far, at) >= reach(tip, base) && ahead && skin.sees(&p, &q, 12)
        };
        short || leaves.iter().any(sibling)
    };
    let Some(&(k, tip, _)) = leaves.iter().find(|leaf| hidden(leaf)) else { return false };
    let at = |tip: usize| skeleton.junctions[tip].point;
    let is_image = |other: usize| skin.symmetric && (at(other) - image(&at(tip))).norm() < 1e-6;
    for (k, ..) in leaves.iter().filter(|leaf| leaf.0 == k || is_image(leaf.1)) {
        remove(graph, &skeleton.arcs[*k], |junction| skeleton.junctions[junction].degree == 1);
    }
    true
}

/// Around a straight branch, at this part of its length, lie circles with radii of these parts.
const RINGS_AT: f64 = 0.6;
const RINGS: [f64; 3] = [0.3, 0.45, 0.6];
const RING_POINTS: usize = 16;

/// Steps of a way, and of how far something is looked for around a hole.
const STEPS: usize = 8;
/// Of fourteen ways out of a hole, so many end in skin.
const CLOSED: usize = 12;

/// Whether the skin from `base` to `tip` is a lump, not a limb: most ways from the middle meet skin as
/// far away as it is long. Holes in it, as a mouth, don't count; the open, as between two legs, does.
fn is_lump(skin: &Skin, base: &Point, tip: &Point) -> bool {
    let way = tip - base;
    let Some(along) = way.try_normalize(1e-9) else { return true };
    let across = along.cross(&if along.x.abs() < 0.6 { Point::x() } else { Point::y() }).normalize();
    let up = along.cross(&across);
    let (middle, length) = (base + way * RINGS_AT, way.norm());
    let filled = (0..RING_POINTS).filter(|k| {
        let (sin, cos) = (*k as f64 * std::f64::consts::TAU / RING_POINTS as f64).sin_cos();
        let out = (across * cos + up * sin) * length;
        let far = RINGS.iter().rev().find(|part| skin.contains(&(middle + out * **part)));
        far.is_some_and(|part| {
            let mut between = (1..STEPS).map(|i| middle + out * (*part * i as f64 / STEPS as f64));
            between.all(|p| skin.contains(&p) || is_hole(skin, &p, length))
        })
    });
    filled.count() * 2 > RING_POINTS
}

/// Whether nearly all ways from `point` meet skin within `reach`.
fn is_hole(skin: &Skin, point: &Point, reach: f64) -> bool {
    let signs = [-1.0, 1.0];
    let axes = [Point::x(), Point::y(), Point::z()].into_iter().flat_map(|axis| signs.map(|s| axis * s));
    let corners = signs.into_iter().flat_map(|x| signs.into_iter().map(move |y| (x, y)));
    let corners = corners.flat_map(|(x, y)| signs.map(|z| Point::new(x, y, z).normalize()));
    let ends =
        |way: &Point| (1..=STEPS).any(|i| skin.contains(&(point + way * (reach * i as f64 / STEPS as f64))));
    axes.chain(corners).filter(ends).count() >= CLOSED
}

/// Removes all that is beyond one branching node where it is in one lump with it: that becomes a
/// leaf. True when there was one.
pub(super) fn drop_crown(skin: &Skin, graph: &mut Graph, skeleton: &CurveSkeleton) -> bool {
    for (base, junction) in skeleton.junctions.iter().enumerate().filter(|(_, j)| j.degree > 2) {
        for trunk in (0..skeleton.arcs.len()).filter(|k| skeleton.arcs[*k].ends.contains(&base)) {
            let Some(crown) = beyond(skeleton, base, trunk) else { continue };
            let ends = crown.iter().flat_map(|k| skeleton.arcs[*k].ends).filter(|end| *end != base);
            if ends.into_iter().all(|end| is_lump(skin, &junction.point, &skeleton.junctions[end].point)) {
                for k in crown {
                    remove(graph, &skeleton.arcs[k], |end| end != base);
                }
                return true;
            }
        }
    }
    false
}

/// The arcs on the other side of a junction than `trunk`; none where a loop leads back.
fn beyond(skeleton: &CurveSkeleton, base: usize, trunk: usize) -> Option<Vec<usize>> {
    let (mut seen, mut found, mut stack) = (vec![base], Vec::new(), vec![base]);
    while let Some(at) = stack.pop() {
        for (k, arc) in skeleton.arcs.iter().enumerate() {
            if k == trunk || found.contains(&k) || !arc.ends.contains(&at) {
                continue;
            }
            found.push(k);
            let end = arc.ends[usize::from(arc.ends[0] == at)];
            if seen.contains(&end) {
                return None;
            }
            seen.push(end);
            stack.push(end);
        }
    }
    let leads_back = skeleton.arcs[trunk].ends.iter().all(|end| seen.contains(end));
    (!leads_back).then_some(found)
}

fn remove(graph: &mut Graph, arc: &Arc, is_leaf: impl Fn(usize) -> bool) {
    let on: Vec<usize> = arc.nodes.iter().flatten().copied().collect();
    let index = |node: usize| graph.node.iter().position(|n| *n == node);
    let steps: Vec<(usize, usize)> = on
        .windows(2)
        .filter_map(|w| Some((index(w[0])?, index(w[1])?)))
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect();
    graph.edges.retain(|e| !steps.contains(e));
    let inner = on.iter().enumerate().filter(|(i, _)| match *i {
        0 => is_leaf(arc.ends[0]),
        i if i + 1 == on.len() => is_leaf(arc.ends[1]),
        _ => true,
    });
    let inner: Vec<usize> = inner.map(|(_, n)| *n).filter(|n| !graph.dropped.contains(n)).collect();
    graph.dropped.extend(inner);
}

/// Merges two branching nodes closer than their radius. True when there were two.
pub(super) fn merge(graph: &mut Graph, skeleton: &CurveSkeleton) -> bool {
    let close = skeleton.arcs.iter().find(|arc| {
        let [a, b] = arc.ends.map(|e| &skeleton.junctions[e]);
        arc.ends[0] != arc.ends[1]
            && a.degree > 2
            && b.degree > 2
            && arc.length() < 0.9 * a.radius.max(b.radius)
    });
    let Some(arc) = close else { return false };
    let [a, b] = arc.ends.map(|e| skeleton.junctions[e].node);
    let index = |graph: &Graph, node: usize| graph.node.iter().position(|n| *n == node);
    remove(graph, arc, |_| false);
    let (Some(a), Some(b)) = (index(graph, a), index(graph, b)) else { return false };
    graph.points[a] = (graph.points[a] + graph.points[b]) * 0.5;
    let edges = std::mem::take(&mut graph.edges);
    for (p, q) in edges {
        let to = |i: usize| if i == b { a } else { i };
        join(&mut graph.edges, to(p), to(q));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::skeleton::curve_skeleton;
    use crate::fixtures::shapes::square_tube;
    use crate::mesh::Polygons;

    #[test]
    fn what_branches_around_a_mouth_is_dropped_and_named() {
        // A neck, a head, and a mouth that keeps the two branches from seeing each other.
        let rings = [(0.0, 0.3), (4.0, 0.3), (4.5, 1.5), (7.5, 1.5), (7.51, 0.3), (5.5, 0.3)];
        let (vertices, faces) = square_tube(&rings);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let ends = [[0.5, 0.0, 0.0], [5.0, 0.0, 0.0], [7.0, 1.0, 0.0], [7.0, -1.0, 0.0]];
        let nodes = ends.map(|[x, y, z]| Point::new(x, y, z));
        let found = curve_skeleton(&skin, &nodes, &[[0, 1], [1, 2], [1, 3]], 0.0, &[]).expect("inside");
        assert_eq!(found.arcs.len(), 1);
        let mut dropped = found.dropped.clone();
        dropped.sort_unstable();
        assert_eq!(dropped, [2, 3]);
    }

    #[test]
    fn a_limb_is_no_lump() {
        let (vertices, faces) = square_tube(&[(0.0, 1.0), (2.0, 1.0), (2.1, 0.2), (4.0, 0.2)]);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let lump = |x: f64| {
            let [base, tip] = [1.0, x].map(|x| skin.space.enter(&Point::new(x, 0.0, 0.0)));
            is_lump(&skin, &base, &tip)
        };
        assert!(lump(1.9));
        assert!(!lump(3.9));
    }

    #[test]
    fn a_limb_among_others_is_no_lump() {
        let (one, faces) = square_tube(&[(0.0, 0.3), (2.0, 0.3), (4.0, 0.3)]);
        let (mut vertices, mut all) = (Vec::new(), Polygons::default());
        for place in 0..9 {
            let aside = Point::new(0.0, f64::from(place % 3 - 1), f64::from(place / 3 - 1));
            all.corners.extend(faces.corners.iter().map(|corner| corner + vertices.len() as i64));
            all.sizes.extend(&faces.sizes);
            vertices.extend(one.iter().map(|p| p + aside));
        }
        let skin = Skin::new(&vertices, &all).expect("closed");
        let [base, tip] = [0.5, 3.9].map(|x| skin.space.enter(&Point::new(x, 0.0, 0.0)));
        assert!(!is_lump(&skin, &base, &tip));
    }
}
