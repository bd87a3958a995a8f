//! Convex hull of points on a sphere, by exact predicates.
//!
//! Incremental: a point replaces the faces that see it by a fan to their horizon. On a sphere no
//! three points are collinear, so points in one plane with a face need no special care: they get a
//! face of their own beside it. `#points²`; meant for tens of points.

use super::predicates::side;
use crate::points::Point;
use std::collections::HashSet;

/// Triangles (outward) of the hull of `points`, or `None` when all lie in one plane.
pub fn hull_on_sphere(points: &[Point]) -> Option<Vec<[u32; 3]>> {
    let first = first_tetrahedron(points)?;
    let [a, b, c, d] = first;
    let mut faces = vec![[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
    for p in 0..points.len() as u32 {
        if !first.contains(&p) {
            add(points, &mut faces, p);
        }
    }
    Some(faces)
}

/// Four points with the last behind the first three.
fn first_tetrahedron(points: &[Point]) -> Option<[u32; 4]> {
    let n = points.len();
    let (a, b) = (0, (1..n).find(|&i| points[i] != points[0])?);
    for c in (1..n).filter(|&c| c != b) {
        for d in c + 1..n {
            match side(&points[a], &points[b], &points[c], &points[d]) {
                1 => return Some([a, b, c, d].map(|i| i as u32)),
                -1 => return Some([a, c, b, d].map(|i| i as u32)),
                _ => {}
            }
        }
    }
    None
}

fn add(points: &[Point], faces: &mut Vec<[u32; 3]>, p: u32) {
    let at = |v: u32| &points[v as usize];
    let (seen, kept): (Vec<[u32; 3]>, Vec<[u32; 3]>) =
        faces.iter().partition(|f| side(at(f[0]), at(f[1]), at(f[2]), at(p)) < 0);
    let edges: HashSet<(u32, u32)> =
        seen.iter().flat_map(|f| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])]).collect();
    *faces = kept;
    // In the order of the faces, so that equal input gives equal output.
    for f in &seen {
        for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
            if !edges.contains(&(b, a)) {
                faces.push([a, b, p]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::random::Random;

    #[test]
    fn every_point_is_a_corner_and_none_is_in_front_of_a_face() {
        let mut random = Random::new(9);
        let points: Vec<Point> = (0..40).map(|_| random.point().normalize()).collect();
        let faces = hull_on_sphere(&points).expect("not flat");
        assert_eq!(faces.len(), 2 * points.len() - 4);
        for f in &faces {
            let [a, b, c] = f.map(|v| &points[v as usize]);
            assert!(points.iter().all(|p| side(a, b, c, p) >= 0));
        }
    }

    #[test]
    fn a_cube_has_twelve_triangles() {
        let corner = |k: usize| {
            Point::new(f64::from(k as u8 & 1), f64::from(k as u8 >> 1 & 1), f64::from(k as u8 >> 2))
        };
        let points: Vec<Point> = (0..8).map(|k| corner(k) * 2.0 - Point::repeat(1.0)).collect();
        assert_eq!(hull_on_sphere(&points).map(|f| f.len()), Some(12));
        assert_eq!(hull_on_sphere(&points[..4]), None);
    }
}
