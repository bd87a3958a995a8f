//! What a generation found and did, in the user's space.

use super::control_nodes::{ControlNode, NodeKind};
use super::sections::Section;
use super::skeleton::CurveSkeleton;
use super::skin::{Repairs, Skin};
use super::Plan;
use crate::geometry::bvh::Bvh;
use crate::points::Point;
use rayon::prelude::*;

/// A control node and its cross section.
#[derive(Debug, Clone)]
pub struct SectionReport {
    /// Bending or leaf.
    pub kind: NodeKind,
    /// Where the control node is on its arc.
    pub place: Point,
    /// Beside it, in the middle of the skin.
    pub point: Point,
    /// Along its bone.
    pub direction: Point,
    /// Radius of the largest ball inside the skin around it.
    pub radius: f64,
    /// The nearest node of the skeleton that was handed in.
    pub node: usize,
    /// The part of the skeleton it is on; sections of one arc are joined in order.
    pub arc: usize,
    /// Where field lines meet the skin.
    pub ring: Vec<Point>,
    /// The corners that the cage gets.
    pub corners: Vec<Point>,
}

/// Stages with their seconds.
pub type Laps = Vec<(&'static str, f64)>;

/// A part of the skeleton between two of its ends and branching nodes, in the user's space.
#[derive(Debug, Clone)]
pub struct ArcReport {
    /// Points along it.
    pub path: Vec<Point>,
    /// For each, the node of the skeleton that was handed in, where it is one.
    pub nodes: Vec<Option<usize>>,
}

/// How a cage came about and how good it is.
#[derive(Debug, Clone)]
pub struct CageReport {
    /// Control nodes with their sections.
    pub sections: Vec<SectionReport>,
    /// For each cage vertex its section.
    pub vertex_sections: Vec<usize>,
    /// Skeleton nodes that take no part: outside the skin, or not sticking out.
    pub dropped: Vec<usize>,
    /// So many vertices are where an earlier cage had them.
    pub kept: usize,
    /// What was done to the skin.
    pub repairs: Repairs,
    /// Volume of the cage over that of the skin.
    pub volume_ratio: f64,
    /// Mean distance of the cage's surface to the skin, over the skin's diagonal.
    pub mean_distance: f64,
    /// Narrowest gap between skin vertices and cage, over the diagonal.
    pub clearance: f64,
    /// Smallest angle of a cage triangle, in degrees.
    pub min_angle: f64,
    /// For each cage vertex its mirror image; none when the cage is not symmetric.
    pub mirror: Option<Vec<u32>>,
    /// Of a cage like another one, whose arcs are in another order: for each the number of its own, from 1,
    /// negative where it is turned.
    pub arrangement: Option<Vec<i64>>,
    /// Loops of the cage.
    pub genus: i64,
    /// Seconds by stage.
    pub timings: Laps,
}

pub(super) fn arcs(skin: &Skin, skeleton: &CurveSkeleton) -> Vec<ArcReport> {
    let leave = |path: &[Point]| path.iter().map(|p| skin.space.leave(p)).collect();
    let arcs = skeleton.arcs.iter();
    arcs.map(|arc| ArcReport { path: leave(&arc.path), nodes: arc.nodes.clone() }).collect()
}

pub(super) fn sections(skin: &Skin, nodes: &[ControlNode], found: &[Section]) -> Vec<SectionReport> {
    let leave = |points: &[Point]| points.iter().map(|p| skin.space.leave(p)).collect();
    nodes
        .iter()
        .zip(found)
        .map(|(node, section)| SectionReport {
            kind: node.kind,
            place: skin.space.leave(&node.place),
            point: skin.space.leave(&node.point),
            direction: node.direction,
            radius: node.radius * skin.space.size,
            node: node.node,
            arc: node.arc,
            ring: leave(&section.ring),
            corners: leave(&section.corners),
        })
        .collect()
}

pub(super) fn cage(
    skin: &Skin,
    plan: &Plan,
    vertices: &[Point],
    (kept, timings): (usize, Laps),
) -> CageReport {
    let Plan { nodes, sections: found, scaffold, mirror, dropped } = plan;
    let unit: Vec<Point> = vertices.iter().map(|p| skin.space.enter(p)).collect();
    let faces = scaffold.triangles();
    let tree = Bvh::new(&unit, &faces);
    let gap = |p: &Point| tree.nearest(&unit, p).map_or(f64::INFINITY, |n| n.distance);
    let mut edges: Vec<(u32, u32)> = faces
        .iter()
        .flat_map(|t| [0, 1, 2].map(|k| (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]))))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    CageReport {
        sections: sections(skin, nodes, found),
        vertex_sections: scaffold.owner.clone(),
        dropped: dropped.clone(),
        kept,
        repairs: skin.repairs,
        volume_ratio: volume(&unit, &faces) / volume(&skin.points, &skin.triangles).abs().max(1e-300),
        mean_distance: mean_distance(skin, &unit, &faces),
        clearance: skin.points.par_iter().map(gap).reduce(|| f64::INFINITY, f64::min),
        min_angle: faces.iter().map(|t| least_angle(t.map(|v| unit[v as usize]))).fold(180.0, f64::min),
        arrangement: None,
        genus: 1 - (vertices.len() as i64 - edges.len() as i64 + faces.len() as i64) / 2,
        mirror: mirror.clone(),
        timings,
    }
}

pub(super) fn volume(points: &[Point], faces: &[[u32; 3]]) -> f64 {
    faces
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| points[v as usize]);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}

/// By area, over places spread evenly in each face.
fn mean_distance(skin: &Skin, points: &[Point], faces: &[[u32; 3]]) -> f64 {
    const CUTS: usize = 6;
    let of_face = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize]);
        let area = (b - a).cross(&(c - a)).norm();
        let (mut sum, mut count) = (0.0, 0.0);
        for i in 0..CUTS {
            for j in 0..CUTS - i {
                let (u, v) = ((i as f64 + 1.0 / 3.0) / CUTS as f64, (j as f64 + 1.0 / 3.0) / CUTS as f64);
                let p = a + (b - a) * u + (c - a) * v;
                sum += skin.tree.nearest(&skin.points, &p).map_or(0.0, |n| n.distance);
                count += 1.0;
            }
        }
        (area * sum / count, area)
    };
    let total = faces.par_iter().map(of_face).reduce(|| (0.0, 0.0), |x, y| (x.0 + y.0, x.1 + y.1));
    total.0 / total.1.max(1e-300)
}

/// A face with a smaller angle, in degrees, is not good to deform with.
pub(super) const NARROW: f64 = 5.0;

pub(super) fn least_angle(t: [Point; 3]) -> f64 {
    (0..3).map(|k| (t[(k + 1) % 3] - t[k]).angle(&(t[(k + 2) % 3] - t[k])).to_degrees()).fold(180.0, f64::min)
}
