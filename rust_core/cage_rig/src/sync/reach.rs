//! Where a cage acts: all of what it encloses, and less and less outside.
//!
//! A cage may enclose a part of the character. Mean value coordinates go on outside of it, but mean
//! less the farther away: skin outside is moved by a part that falls smoothly to nothing over a
//! distance. Where an artist confines the cage further by a mask, the two are multiplied. A joint
//! is the cage's as much as the skin around it is.

use crate::cage::Cage;
use crate::geometry::distance::squared_distance;
use crate::geometry::inside::Enclosure;
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use rayon::prelude::*;

/// A joint looks at this many of the skin vertices nearest to it.
const NEIGHBOURS: usize = 32;
/// Points that one thread takes at a time.
const CHUNK: usize = 256;

/// How much of the cage's movement each of `points` (`#P by 3`) takes part in: 1 inside the cage, and
/// outside falling to 0 at `falloff` mean cage edges from it. `#P · #faces`.
pub fn reach(cage: &Cage, points: &[Point], falloff: f64, part: &Part) -> Result<Vec<f64>, Cancelled> {
    let (vertices, triangles) = (cage.vertices(), cage.triangles());
    let enclosure = Enclosure::new(vertices, triangles);
    let far = (falloff * mean_edge(vertices, triangles)).powi(2);
    let one = |point: &Point| {
        if enclosure.contains(point) {
            return 1.0;
        }
        let corners = |t: &[u32; 3]| t.map(|v| &vertices[v as usize]);
        let distances = triangles.iter().map(|t| squared_distance(point, corners(t)));
        let part = (distances.fold(f64::INFINITY, f64::min) / far).sqrt().min(1.0);
        1.0 - part * part * (3.0 - 2.0 * part)
    };
    let count = part.count(points.len());
    let mut reach = vec![0.0; points.len()];
    reach.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).try_for_each(|(reach, points)| {
        reach.iter_mut().zip(points).for_each(|(part, point)| *part = one(point));
        count.step(points.len())
    })?;
    Ok(reach)
}

fn mean_edge(vertices: &[Point], triangles: &[[u32; 3]]) -> f64 {
    let length = |a: u32, b: u32| (vertices[a as usize] - vertices[b as usize]).norm();
    let sum: f64 = triangles.iter().map(|&[a, b, c]| length(a, b) + length(b, c) + length(c, a)).sum();
    sum / (3 * triangles.len()) as f64
}

/// The skin around each joint, by which a joint takes part in what moves the skin.
#[derive(Debug, Clone)]
pub struct Surroundings {
    near: Vec<Vec<(usize, f64)>>,
}

impl Surroundings {
    /// Finds the vertices of `skin` (`#M by 3`) nearest to each of `joints` (`#J by 3`) and shares
    /// that fall with the square of their distance. `#J · #M`.
    pub fn new(skin: &[[f32; 3]], joints: &[Point], part: &Part) -> Result<Self, Cancelled> {
        let done = part.count(joints.len());
        let near = |joint: &Point| {
            let mut squared: Vec<(usize, f64)> = skin
                .iter()
                .map(|p| (joint - Point::new(p[0].into(), p[1].into(), p[2].into())).norm_squared())
                .enumerate()
                .collect();
            let count = NEIGHBOURS.min(squared.len());
            if count < squared.len() {
                squared.select_nth_unstable_by(count, |a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
                squared.truncate(count);
            }
            let nearest = squared.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
            // The nearest one itself has a share of 1, also where the joint lies on it.
            let shares = squared.iter().map(|(_, d)| if *d > 0.0 { nearest / d } else { 1.0 });
            let total: f64 = shares.clone().sum();
            done.step(1)?;
            Ok(squared.iter().zip(shares).map(|((i, _), share)| (*i, share / total)).collect())
        };
        Ok(Self { near: joints.par_iter().map(near).collect::<Result<_, Cancelled>>()? })
    }

    /// How much each joint takes part, where the skin does by `mask` (`#M`).
    pub fn joints(&self, mask: &[f32]) -> Vec<f64> {
        let mean = |near: &Vec<(usize, f64)>| near.iter().map(|&(i, share)| share * f64::from(mask[i])).sum();
        self.near.iter().map(mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::shapes::icosphere;
    use crate::mesh::Polygons;
    use crate::progress::unwatched;

    fn sphere() -> Cage {
        let (vertices, triangles) = icosphere(1);
        Cage::new(vertices, &Polygons::from_triangles(&triangles)).expect("a sphere is a cage")
    }

    #[test]
    fn reach_is_whole_inside_and_falls_to_nothing_outside() {
        let cage = sphere();
        let along = |x: f64| Point::new(0.1, 0.2, 1.0).normalize() * x;
        let points = [0.0, 0.5, 1.05, 1.2, 1.4, 9.0].map(along);
        let found = unwatched(|part| reach(&cage, &points, 1.0, part));
        assert_eq!(found[..2], [1.0, 1.0]);
        assert!(found[2] > 0.8 && found[2] > found[3] && found[3] > found[4] && found[4] > 0.0, "{found:?}");
        assert_eq!(found[5], 0.0);
    }

    #[test]
    fn a_joint_is_moved_as_the_skin_around_it() {
        let skin: Vec<[f32; 3]> =
            (0..400).map(|i| [0.01 * i as f32, (i % 7) as f32, (i % 5) as f32]).collect();
        let joints = [Point::new(0.2, 1.0, 1.0), Point::new(3.9, 1.0, 1.0)];
        let around = unwatched(|part| Surroundings::new(&skin, &joints, part));
        let whole = around.joints(&vec![1.0; 400]);
        assert!(whole.iter().all(|m| (m - 1.0).abs() < 1e-12));
        let half: Vec<f32> = (0..400).map(|i| if i < 200 { 1.0 } else { 0.0 }).collect();
        let found = around.joints(&half);
        assert!(found[0] > 0.99 && found[1] < 0.01, "{found:?}");
    }
}
