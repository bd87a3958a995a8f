//! A symmetric character gets a symmetric cage.
//!
//! The plane looked for is x = middle of the bounding box, as characters are modelled. Where the skin
//! is its own mirror image there, each section takes the image of its partner's corners, and a
//! section on the plane is evened out. Inflation then keeps the vertices mirrored, whatever way faces
//! across the plane are split. Linear in the samples and quadratic in the sections.

use super::control_nodes::ControlNode;
use super::sections::Section;
use super::skin::Skin;
use crate::points::Point;
use rayon::prelude::*;

/// How far a mirrored skin vertex may be from the skin, relative to the size.
const TOLERANCE: f64 = 1e-3;

pub(super) fn image(p: &Point) -> Point {
    Point::new(-p.x, p.y, p.z)
}

/// Whether the skin is its own mirror image in x.
pub(crate) fn is_symmetric(skin: &Skin) -> bool {
    let stride = (skin.points.len() / 500).max(1);
    let samples: Vec<&Point> = skin.points.iter().step_by(stride).collect();
    let near =
        |p: &&Point| skin.tree.nearest(&skin.points, &image(p)).is_some_and(|n| n.distance < TOLERANCE);
    samples.par_iter().all(near)
}

/// Of the direction of a limb at the plane, the part in x from which on it crosses the plane.
const ACROSS: f64 = 0.7;

/// How far a node of the skeleton may be from where its partner is mirrored to, relative to the size.
const NEAR: f64 = 0.03;

/// The graph of a skeleton (user's space) with every node at the mirror image of another, or on the
/// plane, and every edge with its image; `None` where nodes have no partners.
pub(crate) fn mirror_graph(
    skin: &Skin,
    nodes: &[Point],
    edges: &[[i64; 2]],
) -> Option<(Vec<Point>, Vec<[i64; 2]>)> {
    let points: Vec<Point> = nodes.iter().map(|p| skin.space.enter(p)).collect();
    let apart = |i: usize, j: usize| (image(&points[i]) - points[j]).norm();
    let nearest = |i: usize| (0..points.len()).min_by(|a, b| apart(i, *a).total_cmp(&apart(i, *b)));
    let partner: Vec<usize> = (0..points.len()).map(nearest).collect::<Option<_>>()?;
    if (0..points.len()).any(|i| partner[partner[i]] != i || apart(i, partner[i]) > NEAR) {
        return None;
    }
    let even = |i: usize| (points[i] + image(&points[partner[i]])) * 0.5;
    let nodes = (0..points.len()).map(|i| skin.space.leave(&even(i))).collect();
    // An edge that its image lacks was made on one side only: that of the greater x.
    let inside = |n: i64| usize::try_from(n).ok().filter(|n| *n < points.len());
    let mut found: Vec<[i64; 2]> = Vec::new();
    for &[a, b] in edges {
        let (i, j) = (inside(a)?, inside(b)?);
        let other = [partner[i] as i64, partner[j] as i64];
        let there = edges.iter().any(|e| *e == other || *e == [other[1], other[0]]);
        let side = points[i].x + points[j].x;
        if there || side > 0.0 {
            found.push([a, b]);
        }
        if !there && side > 0.0 {
            found.push(other);
        }
    }
    Some((nodes, found))
}

/// For each control node that at its mirror image; `None` when some node has none.
pub(crate) fn partners(nodes: &[ControlNode]) -> Option<Vec<usize>> {
    let partner = |i: usize| {
        let wanted = image(&nodes[i].point);
        let distance = |j: usize| (nodes[j].point - wanted).norm();
        let best = (0..nodes.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
        (distance(best) < nodes[i].radius && nodes[best].kind == nodes[i].kind).then_some(best)
    };
    let found: Vec<usize> = (0..nodes.len()).map(partner).collect::<Option<_>>()?;
    (0..nodes.len()).all(|i| found[found[i]] == i).then_some(found)
}

/// Moves the second of every two mirrored nodes to the image of the first.
pub(crate) fn mirror_nodes(nodes: &mut [ControlNode], partners: &[usize]) {
    for (i, &j) in partners.iter().enumerate().filter(|(i, j)| i < j) {
        let along = image(&nodes[i].direction);
        let sign = if along.dot(&nodes[j].direction) > 0.0 { 1.0 } else { -1.0 };
        nodes[j].point = image(&nodes[i].point);
        nodes[j].direction = along * sign;
        nodes[j].radius = nodes[i].radius;
    }
}

/// Makes the sections symmetric. For each corner its mirror image; `None`, and nothing changed, when
/// the corners of a section on the plane don't pair up.
pub(crate) fn symmetrise(
    nodes: &[ControlNode],
    sections: &mut [Section],
    partners: &[usize],
) -> Option<Vec<u32>> {
    let count = sections.first()?.corners.len();
    let mut mirror = vec![0; count * sections.len()];
    let mut changed = sections.to_vec();
    for (i, &j) in partners.iter().enumerate() {
        if i == j {
            let pairs = pair_up(&sections[i].corners, nodes[i].direction.x.abs() > ACROSS)?;
            for (k, &m) in pairs.iter().enumerate() {
                mirror[i * count + k] = (i * count + m) as u32;
                changed[i].corners[k] = (sections[i].corners[k] + image(&sections[i].corners[m])) * 0.5;
            }
        } else if i < j {
            // A mirror image turns the other way, and so does a partner whose arc runs backward.
            let along = image(&nodes[i].direction).dot(&nodes[j].direction) > 0.0;
            changed[j].ring = sections[i].ring.iter().rev().map(image).collect();
            if !along {
                changed[j].ring.reverse();
            }
            for k in 0..count {
                let m = if along { count - 1 - k } else { k };
                changed[j].corners[m] = image(&sections[i].corners[k]);
                mirror[i * count + k] = (j * count + m) as u32;
                mirror[j * count + m] = (i * count + k) as u32;
            }
        }
    }
    for section in &mut changed {
        section.center = section.corners.iter().sum::<Point>() / count as f64;
    }
    sections.clone_from_slice(&changed);
    Some(mirror)
}

/// For each corner the one that its mirror image is nearest to; `None` when they don't pair up. A section of a limb
/// that crosses the plane (`across`) lies in it and stays as it is; that of a thin fin may seem to.
fn pair_up(corners: &[Point], across: bool) -> Option<Vec<usize>> {
    let n = corners.len();
    if across {
        return Some((0..n).collect());
    }
    // A reflection reverses the ring: corner k goes to s − k for one s.
    let cost = |s: usize| {
        (0..n).map(|k| (image(&corners[k]) - corners[(s + n - k) % n]).norm_squared()).sum::<f64>()
    };
    let flipped = (0..n).min_by(|a, b| cost(*a).total_cmp(&cost(*b)))?;
    Some((0..n).map(|k| (flipped + n - k) % n).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_graph_that_is_almost_symmetric_becomes_symmetric() {
        let rings: Vec<(f64, f64)> = (0..11).map(|i| (f64::from(i) - 5.0, 1.0)).collect();
        let (vertices, faces) = crate::fixtures::shapes::square_tube(&rings);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let nodes = [(0.02, 0.0), (4.0, 0.1), (-4.1, 0.0), (4.5, 0.1)].map(|(x, y)| Point::new(x, y, 0.0));
        let (points, edges) = mirror_graph(&skin, &nodes[..3], &[[0, 1]]).expect("partners");
        assert!(points[0].x.abs() < 1e-12 && (image(&points[1]) - points[2]).norm() < 1e-12);
        assert_eq!(edges, [[0, 1], [0, 2]], "the edge of one side has its image");
        assert!(mirror_graph(&skin, &nodes, &[[0, 1]]).is_none(), "the fourth has no partner");
        assert!(is_symmetric(&skin));
    }

    #[test]
    fn corners_pair_up_across_the_plane_and_stay_within_it() {
        let square = [(1.0, 1.0), (-1.1, 1.0), (-1.0, -1.0), (1.0, -0.9)].map(|(x, y)| Point::new(x, y, 0.0));
        assert_eq!(pair_up(&square, false), Some(vec![1, 0, 3, 2]));
        let within =
            [(1.0, 1.0), (-1.1, 1.0), (-1.0, -1.0), (1.0, -0.9)].map(|(y, z)| Point::new(0.01, y, z));
        assert_eq!(pair_up(&within, true), Some(vec![0, 1, 2, 3]));
        // Of a fin: far longer than it is thick, and its corners are not quite across from one another.
        let fin =
            [(-0.002, 0.0), (-0.002, 1.0), (0.002, 0.9), (0.002, 0.2)].map(|(x, y)| Point::new(x, y, 0.0));
        assert_eq!(pair_up(&fin, false), Some(vec![3, 2, 1, 0]));
    }
}
