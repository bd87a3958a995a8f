//! Which section of an earlier cage each section comes from.
//!
//! Sections at the same node are the same. Between those, an arc's other sections are paired in their
//! order, leaves with leaves; what is left over is new, or was removed. Quadratic in an arc's sections.

use super::control_nodes::{ControlNode, NodeKind};
use super::skeleton::CurveSkeleton;

/// Nodes this near to each other are one, relative to the size.
const SAME: f64 = 1e-4;

/// For the sections of a cage, section after section.
#[derive(Debug, Default)]
pub(crate) struct Lineage {
    /// The earlier section whose place it takes; none where it is new.
    pub(crate) origin: Vec<Option<usize>>,
    /// Whether it is still at the same node.
    pub(crate) same: Vec<bool>,
    /// Earlier sections that have no successor.
    pub(crate) gone: Vec<usize>,
}

impl Lineage {
    /// Of nodes `now`, from nodes `before` on the same skeleton.
    pub(crate) fn new(skeleton: &CurveSkeleton, before: &[ControlNode], now: &[ControlNode]) -> Self {
        let (mut origin, mut same) = (vec![None; now.len()], vec![false; now.len()]);
        for arc in 0..skeleton.arcs.len() {
            let on_arc = |nodes: &[ControlNode]| (0..nodes.len()).filter(|n| nodes[*n].arc == arc).collect();
            let (old, new): (Vec<usize>, Vec<usize>) = (on_arc(before), on_arc(now));
            let apart = |i: usize, j: usize| (now[i].place - before[j].place).norm();
            let alike = |i: usize, j: usize| now[i].kind == before[j].kind;
            let (mut from, mut first) = (0, 0);
            for (at, &i) in new.iter().enumerate() {
                let found = (from..old.len()).find(|k| alike(i, old[*k]) && apart(i, old[*k]) < SAME);
                if let Some(k) = found {
                    origin[i] = Some(old[k]);
                    same[i] = true;
                    pair_up(&new[first..at], &old[from..k], (&alike, &apart), &mut origin);
                    (from, first) = (k + 1, at + 1);
                }
            }
            pair_up(&new[first..], &old[from..], (&alike, &apart), &mut origin);
        }
        let mut found = Self { origin, same, gone: Vec::new() };
        found.yield_ends(skeleton, before, now);
        found.gone = (0..before.len()).filter(|old| !found.origin.contains(&Some(*old))).collect();
        found
    }

    pub(crate) fn is_unchanged(&self) -> bool {
        self.gone.is_empty() && self.same.iter().all(|same| *same)
    }

    /// Faces around branching nodes stay. The section nearest to one takes the place of the one that was:
    /// a new one of its neighbour, which moves on, and one that moves up of the one that is gone.
    fn yield_ends(&mut self, skeleton: &CurveSkeleton, before: &[ControlNode], now: &[ControlNode]) {
        for arc in 0..skeleton.arcs.len() {
            let on_arc = |nodes: &[ControlNode]| (0..nodes.len()).filter(|n| nodes[*n].arc == arc).collect();
            let (mut old, mut new): (Vec<usize>, Vec<usize>) = (on_arc(before), on_arc(now));
            for _ in 0..2 {
                let end = new.first().zip(old.first()).filter(|(i, j)| {
                    let bending = now[**i].kind == NodeKind::Bending && before[**j].kind == NodeKind::Bending;
                    bending && self.origin[**i] != Some(**j)
                });
                if let Some((&first, &was)) = end {
                    // Whoever has that place, or the first that has one, moves.
                    let taken = new.iter().find(|n| self.origin[**n] == Some(was)).copied();
                    if let Some(other) = taken {
                        (self.origin[other], self.same[other]) = (None, false);
                    }
                    (self.origin[first], self.same[first]) = (Some(was), false);
                }
                old.reverse();
                new.reverse();
            }
        }
    }
}

type Alike<'a> = (&'a dyn Fn(usize, usize) -> bool, &'a dyn Fn(usize, usize) -> f64);

/// Pairs what is between two sections that are the same, in order, the nearest of each kind.
fn pair_up(new: &[usize], old: &[usize], (alike, apart): Alike, origin: &mut [Option<usize>]) {
    let of_kind = |one: &[usize], other: &[usize], swapped: bool| -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        let mut from = 0;
        for (at, &a) in one.iter().enumerate() {
            // So many of the other kind are left for those that follow.
            let last = (other.len() + at + 1).saturating_sub(one.len());
            let fits = |k: &usize| if swapped { alike(other[*k], a) } else { alike(a, other[*k]) };
            let far = |k: &usize| if swapped { apart(other[*k], a) } else { apart(a, other[*k]) };
            let best = (from..last).filter(fits).min_by(|x, y| far(x).total_cmp(&far(y)));
            if let Some(k) = best {
                pairs.push(if swapped { (other[k], a) } else { (a, other[k]) });
                from = k + 1;
            }
        }
        pairs
    };
    let pairs = if new.len() <= old.len() { of_kind(new, old, false) } else { of_kind(old, new, true) };
    for (i, j) in pairs {
        origin[i] = Some(j);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::skeleton::{Arc, Junction};
    use crate::points::Point;

    fn skeleton() -> CurveSkeleton {
        let junction = |node, degree| Junction { point: Point::zeros(), radius: 1.0, node, degree };
        let arc = Arc { ends: [0, 1], path: vec![], along: vec![], radii: vec![], nodes: vec![] };
        CurveSkeleton { junctions: vec![junction(0, 3), junction(1, 1)], arcs: vec![arc], dropped: vec![] }
    }

    /// Bending nodes along an arc from a branching node, and the leaf at its end.
    fn nodes(places: &[f64]) -> Vec<ControlNode> {
        let node = |(k, x): (usize, &f64)| {
            let kind = if k + 1 == places.len() { NodeKind::Leaf } else { NodeKind::Bending };
            let point = Point::x() * *x;
            ControlNode { kind, arc: 0, place: point, point, direction: Point::x(), radius: 0.5, node: 0 }
        };
        places.iter().enumerate().map(node).collect()
    }

    #[test]
    fn sections_come_from_those_at_the_same_node_and_from_the_nearest_between() {
        let before = nodes(&[1.0, 2.0, 3.0, 5.0]);
        let of = |now: &[f64]| Lineage::new(&skeleton(), &before, &nodes(now));
        let moved = of(&[1.0, 2.4, 3.0, 5.0]);
        assert_eq!(moved.origin, [Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(moved.same, [true, false, true, true]);
        assert!(moved.gone.is_empty() && !moved.is_unchanged());
        assert!(of(&[1.0, 2.0, 3.0, 5.0]).is_unchanged());
        let removed = of(&[1.0, 3.0, 5.0]);
        assert_eq!((removed.origin, removed.gone), (vec![Some(0), Some(2), Some(3)], vec![1]));
        let new = of(&[1.0, 2.0, 2.5, 3.0, 4.9]);
        assert_eq!(new.origin, [Some(0), Some(1), None, Some(2), Some(3)], "the leaf has moved");
        assert!(!new.same[4]);
        let both = of(&[1.0, 1.9, 2.2, 3.0, 5.0]);
        assert_eq!(both.origin, [Some(0), Some(1), None, Some(2), Some(3)]);
    }

    #[test]
    fn the_place_next_to_a_branching_node_is_always_taken() {
        let before = nodes(&[1.0, 2.0, 5.0]);
        let new = Lineage::new(&skeleton(), &before, &nodes(&[0.5, 1.0, 2.0, 5.0]));
        assert_eq!(new.origin, [Some(0), None, Some(1), Some(2)], "the one that was there moves on");
        assert_eq!(new.same, [false, false, true, true]);
        let removed = Lineage::new(&skeleton(), &before, &nodes(&[2.0, 5.0]));
        assert_eq!((removed.origin, removed.gone), (vec![Some(0), Some(2)], vec![1]));
        assert_eq!(removed.same, [false, true]);
    }
}
