//! Small rings: where the corners of sections are before the cage grows.
//!
//! Sections shrunk about their centers make the best start, as their hulls have the faces that the
//! grown cage wants. Where shrunk sections cross at every size, because they lean or are twisted
//! against each other, regular rings at right angles to the cage's axis don't, once they are small
//! enough. Linear in the sections.

use super::control_nodes::ControlNode;
use super::sections::{frame, Section};
use crate::points::Point;

/// The sizes to try, in this order.
pub(crate) const STARTS: [Start; 10] = [
    Start::Shrunk(0.7),
    Start::Shrunk(0.5),
    Start::Shrunk(0.35),
    Start::Shrunk(0.2),
    Start::Regular(0.5),
    Start::Regular(0.3),
    Start::Regular(0.15),
    Start::Regular(0.08),
    Start::Regular(0.04),
    Start::Regular(0.02),
];

/// What the rings are made from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Start {
    /// Sections, scaled by this.
    Shrunk(f64),
    /// Regular polygons of this radius, in radii of the inscribed balls.
    Regular(f64),
}

impl Start {
    /// Corners, section after section.
    pub(crate) fn corners(self, nodes: &[ControlNode], sections: &[Section]) -> Vec<Point> {
        let ring = |at: usize| match self {
            Self::Shrunk(scale) => {
                let Section { corners, center, .. } = &sections[at];
                corners.iter().map(|p| center + (p - center) * scale).collect()
            }
            Self::Regular(scale) => regular(nodes, sections, at, scale * nodes[at].radius),
        };
        (0..nodes.len()).flat_map(ring).collect()
    }
}

/// The direction of the axis at a section: half way between the directions to its neighbours.
fn along(nodes: &[ControlNode], sections: &[Section], at: usize) -> Point {
    let neighbour =
        |other: Option<usize>| other.filter(|o| nodes.get(*o).is_some_and(|n| n.arc == nodes[at].arc));
    let to = |other: usize| (sections[other].center - sections[at].center).try_normalize(1e-12);
    let after = neighbour(Some(at + 1)).and_then(to);
    let before = neighbour(at.checked_sub(1)).and_then(to).map(|d| -d);
    let own = nodes[at].direction;
    let sum = before.unwrap_or(own) + after.unwrap_or(own);
    sum.try_normalize(1e-3).unwrap_or(own)
}

fn regular(nodes: &[ControlNode], sections: &[Section], at: usize, radius: f64) -> Vec<Point> {
    let Section { corners, center, .. } = &sections[at];
    let direction = along(nodes, sections, at);
    let (u, v) = frame(&direction);
    let step = std::f64::consts::TAU / corners.len() as f64;
    // The turn that brings the ring nearest to the corners.
    let (mut x, mut y) = (0.0, 0.0);
    for (k, p) in corners.iter().enumerate() {
        let out = p - center;
        let (c, s) = (out.dot(&u), out.dot(&v));
        let turn = s.atan2(c) - k as f64 * step;
        x += turn.cos() * c.hypot(s);
        y += turn.sin() * c.hypot(s);
    }
    let first = y.atan2(x);
    let place = |k: usize| {
        let angle = first + k as f64 * step;
        center + (u * angle.cos() + v * angle.sin()) * radius
    };
    (0..corners.len()).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::control_nodes::NodeKind;

    #[test]
    fn a_regular_ring_is_turned_to_its_section_and_stands_across_the_axis() {
        let node = |x: f64| ControlNode {
            kind: NodeKind::Bending,
            arc: 0,
            place: Point::x() * x,
            point: Point::x() * x,
            direction: Point::x(),
            radius: 1.0,
            node: 0,
        };
        let section = |x: f64| {
            let corners: Vec<Point> = [(1.0, 1.0), (-1.0, 1.2), (-1.0, -1.0), (1.0, -1.1)]
                .map(|(y, z)| Point::new(x + 0.4 * y, y, z))
                .to_vec();
            Section { ring: corners.clone(), corners, center: Point::x() * x }
        };
        let (nodes, sections) = ([node(0.0), node(2.0)], [section(0.0), section(2.0)]);
        let found = Start::Regular(0.1).corners(&nodes, &sections);
        for (k, p) in found.iter().enumerate() {
            let center = Point::x() * (if k < 4 { 0.0 } else { 2.0 });
            assert!(((p - center).norm() - 0.1).abs() < 1e-12 && (p - center).x.abs() < 1e-12, "{p}");
            let corner = sections[k / 4].corners[k % 4] - center;
            assert!((p - center).dot(&corner) > 0.09 * corner.yz().norm(), "{k}");
        }
    }
}
