//! Ends of the skeleton: what folds back is dropped, the others are led on to the skin.
//!
//! Bones end where an armature's author left them, in the middle of a head or past a hand. Led on
//! along the middle of the limb until it is thin, an arc shows where its radius changes, up to its
//! tip. A tip costs some tens of nearest points.

use super::control_nodes::median;
use super::skeleton::{climb, Arc, CurveSkeleton, Graph};
use super::skin::Skin;
use crate::points::Point;

/// Where a tip is as thin as this part of its arc, it ends.
pub(super) const THIN: f64 = 0.3;

/// Drops ends that lie on the bone they hang from, or within half the radius of it. Whether there were any.
pub(super) fn unfold(skin: &Skin, graph: &mut Graph) -> bool {
    let before = graph.edges.len();
    loop {
        let around = |i: usize| {
            graph.edges.iter().filter_map(move |&(a, b)| match (a == i, b == i) {
                (true, _) => Some(b),
                (_, true) => Some(a),
                _ => None,
            })
        };
        let folded = (0..graph.points.len()).find_map(|tip| {
            let mut near = around(tip);
            let (base, None) = (near.next()?, near.next()) else { return None };
            let mut others = around(base).filter(|k| *k != tip);
            let (next, None) = (others.next()?, others.next()) else { return None };
            let [p, q, x] = [base, next, tip].map(|i| graph.points[i]);
            let way = q - p;
            let t = ((x - p).dot(&way) / way.norm_squared().max(1e-300)).clamp(0.0, 1.0);
            let apart = (p + way * t - x).norm();
            (t > 0.0 && apart < 0.5 * skin.depth(&x)).then_some((tip, base))
        });
        let Some((tip, base)) = folded else { return graph.edges.len() < before };
        graph.edges.retain(|e| *e != (tip.min(base), tip.max(base)));
        graph.dropped.push(graph.node[tip]);
    }
}

/// Leads every end of the skeleton on to where its limb is thin.
pub(super) fn lead_on(skin: &Skin, skeleton: &mut CurveSkeleton) {
    for k in 0..skeleton.arcs.len() {
        // Both ends of the arc as it was: neither is thin by what the other added.
        let found = [0, 1].map(|side| beyond(skin, &skeleton.arcs[k], side));
        for (side, found) in found.into_iter().enumerate() {
            let junction = skeleton.arcs[k].ends[side];
            if skeleton.junctions[junction].degree == 1 {
                if let Some((tip, radius)) = found.last() {
                    (skeleton.junctions[junction].point, skeleton.junctions[junction].radius) =
                        (*tip, *radius);
                }
                skeleton.arcs[k].append(side, &found);
            }
        }
    }
}

/// Points beyond one end of an arc, with their depths.
fn beyond(skin: &Skin, arc: &Arc, side: usize) -> Vec<(Point, f64)> {
    let thin = THIN * median(arc.radii.clone());
    let end = if side == 0 { 0.0 } else { arc.length() };
    let ahead = arc.direction(end, 0.1 * arc.length());
    let out = if side == 0 { -ahead } else { ahead };
    let step = 0.25 * thin.max(2e-3);
    let mut at = arc.at(end);
    let mut found = Vec::new();
    for _ in 0..400 {
        let next = climb(skin, at + out * step, Some(out));
        let depth = skin.depth(&next);
        if depth < thin || (next - at).dot(&out) < 0.2 * step {
            break;
        }
        at = next;
        found.push((at, depth));
    }
    found
}

#[cfg(test)]
mod tests {
    use crate::caging::skeleton::curve_skeleton;
    use crate::caging::skin::Skin;
    use crate::fixtures::shapes::square_tube;
    use crate::points::Point;

    fn bar() -> Skin {
        let rings: Vec<(f64, f64)> = (0..11).map(|i| (f64::from(i), 1.0)).collect();
        let (vertices, faces) = square_tube(&rings);
        Skin::new(&vertices, &faces).expect("closed")
    }

    #[test]
    fn a_short_bone_is_led_on_to_both_ends() {
        let (skin, bones) = (bar(), [4.0, 6.0].map(|x| Point::new(x, 0.0, 0.0)));
        let found = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
        let [a, b] = [0, 1].map(|k| skin.space.leave(&found.junctions[found.arcs[0].ends[k]].point));
        assert!(a.x.min(b.x) < 0.6 && a.x.max(b.x) > 9.4, "{a} {b}");
        assert!(a.yz().norm() < 0.1 && b.yz().norm() < 0.1);
        let arc = &found.arcs[0];
        let named: Vec<usize> = arc.nodes.iter().flatten().copied().collect();
        assert_eq!(named, [0, 1], "what is led on has no nodes");
        assert!(arc.along.windows(2).all(|w| w[0] < w[1]) && arc.along[0] == 0.0);
        assert_eq!(arc.path.len(), arc.radii.len());
    }

    #[test]
    fn a_bone_that_folds_back_is_dropped() {
        let skin = bar();
        let bones = [9.0, 6.0, 3.0, 5.0].map(|x| Point::new(x, 0.0, 0.0));
        let found = curve_skeleton(&skin, &bones, &[[0, 1], [1, 2], [2, 3]], 0.0, &[]).expect("inside");
        assert_eq!(found.dropped, [3]);
        assert_eq!(found.arcs.len(), 1);
    }

    #[test]
    fn a_bone_that_folds_back_once_what_hangs_from_it_is_pruned_is_dropped() {
        let skin = bar();
        let mut bones = [9.0, 6.0, 3.0, 5.0].map(|x| Point::new(x, 0.0, 0.0)).to_vec();
        bones.extend([0.3, -0.3].map(|y| Point::new(4.4, y, 0.0)));
        let edges = [[0, 1], [1, 2], [2, 3], [3, 4], [3, 5]];
        let found = curve_skeleton(&skin, &bones, &edges, 0.0, &[]).expect("inside");
        assert_eq!(found.arcs.len(), 1);
        let named: Vec<usize> = found.arcs[0].nodes.iter().flatten().copied().collect();
        assert!(named == [0, 1, 2] || named == [2, 1, 0], "{named:?}");
    }
}
