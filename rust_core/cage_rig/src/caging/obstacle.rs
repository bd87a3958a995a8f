//! The stand-in that the cage grows around: the skin with a manageable number of triangles.
//!
//! A fine skin is decimated, and the cage keeps a margin that covers what sticks out of the stand-in;
//! a coarse one is subdivided, which leaves its surface as it is, so that it bends with the axis.

use super::skin::Skin;
use crate::geometry::bvh::Bvh;
use crate::geometry::decimate::decimate;
use crate::points::Point;
use rayon::prelude::*;
use std::collections::HashMap;

/// Triangles that growth is quick with.
const MANY: usize = 9000;
const FEW: usize = 4000;

/// Points and triangles, and how far the skin sticks out of them. Unit space.
pub(crate) fn proxy(skin: &Skin) -> ((Vec<Point>, Vec<[u32; 3]>), f64) {
    if skin.triangles.len() > MANY {
        let (points, triangles) = decimate(&skin.points, &skin.triangles, MANY * 2 / 3);
        let tree = Bvh::new(&points, &triangles);
        let out = |p: &Point| match tree.winding(&points, p) {
            0 => tree.nearest(&points, p).map_or(0.0, |n| n.distance),
            _ => 0.0,
        };
        let margin = skin.points.par_iter().map(out).reduce(|| 0.0, f64::max);
        return ((points, triangles), margin);
    }
    let mut mesh = (skin.points.clone(), skin.triangles.clone());
    while mesh.1.len() < FEW {
        mesh = subdivide(&mesh.0, &mesh.1);
    }
    (mesh, 0.0)
}

/// Every triangle cut into four at the middles of its sides.
fn subdivide(points: &[Point], triangles: &[[u32; 3]]) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut points = points.to_vec();
    let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
    let mut finer = Vec::with_capacity(4 * triangles.len());
    for t in triangles {
        let m = [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]) * 0.5);
                points.len() as u32 - 1
            })
        });
        finer.extend([[t[0], m[0], m[2]], [m[0], t[1], m[1]], [m[2], m[1], t[2]], m]);
    }
    (points, finer)
}
