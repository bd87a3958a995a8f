//! The last word on a cage: exact, on the full meshes, in the numbers that are handed out.
//!
//! A cage is valid when it is closed, manifold and outward ([`Cage`] refuses what isn't), no two of
//! its triangles touch beyond common corners, none touches the skin, and a point of each part of the
//! skin is inside. Exact predicates behind boxes; `n log n`.

use super::report::least_angle;
use crate::cage::Cage;
use crate::geometry::bvh::Bvh;
use crate::geometry::intersections::{neighbours_touch, triangles_touch};
use crate::mesh::Polygons;
use crate::points::Point;
use rayon::prelude::*;

/// What is wrong with a cage, and at which of its vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) vertex: usize,
    pub(crate) what: &'static str,
}

/// Checks a cage against a skin, both in one space. `None`: valid.
pub(crate) fn fault(
    cage: &[Point],
    faces: &[[u32; 3]],
    skin: &[Point],
    triangles: &[[u32; 3]],
) -> Option<Fault> {
    let polygons = Polygons::from_triangles(faces);
    match Cage::new(cage.to_vec(), &polygons) {
        Err(_) => return Some(Fault { vertex: 0, what: "it is not a closed manifold" }),
        Ok(cage) if cage.turned() => return Some(Fault { vertex: 0, what: "it is inside out" }),
        Ok(_) => {}
    }
    if let Some(vertex) = first_self_crossing(cage, faces) {
        return Some(Fault { vertex: vertex as usize, what: "it crosses itself" });
    }
    let tree = Bvh::new(cage, faces);
    let vertex = first_outside(&tree, cage, skin, triangles)?;
    Some(Fault { vertex: vertex as usize, what: "it does not enclose the skin" })
}

/// A vertex of the first pair of faces that touch.
pub(crate) fn first_self_crossing(points: &[Point], faces: &[[u32; 3]]) -> Option<u32> {
    let tree = Bvh::new(points, faces);
    let crosses = |at: usize| {
        let [a, b, c] = faces[at].map(|v| points[v as usize]);
        let mut found = false;
        tree.in_box(&a.inf(&b).inf(&c), &a.sup(&b).sup(&c), |other| {
            found =
                found || (other as usize > at && neighbours_touch(points, faces[at], faces[other as usize]));
        });
        found
    };
    (0..faces.len()).into_par_iter().find_first(|at| crosses(*at)).map(|at| faces[at][0])
}

/// Triangles of the skin that touch the cage of `tree`, each with a cage vertex there.
pub(crate) fn crossing(
    tree: &Bvh,
    cage: &[Point],
    skin: &[Point],
    triangles: &[[u32; 3]],
) -> Vec<(u32, usize)> {
    let faces = tree.triangles();
    let touches = |(at, t): (usize, &[u32; 3])| {
        let [a, b, c] = t.map(|v| &skin[v as usize]);
        let mut found = None;
        tree.in_box(&a.inf(b).inf(c), &a.sup(b).sup(c), |face| {
            if found.is_none() && triangles_touch([a, b, c], faces[face as usize].map(|v| &cage[v as usize]))
            {
                found = Some((faces[face as usize][0], at));
            }
        });
        found
    };
    triangles.par_iter().enumerate().filter_map(touches).collect()
}

/// A cage vertex near the first triangle of the skin that is not wholly inside the cage of `tree`.
pub(crate) fn first_outside(
    tree: &Bvh,
    cage: &[Point],
    skin: &[Point],
    triangles: &[[u32; 3]],
) -> Option<u32> {
    if let Some((vertex, _)) = crossing(tree, cage, skin, triangles).first() {
        return Some(*vertex);
    }
    // Nothing crosses: each connected part is inside or outside as a whole.
    let mut root: Vec<u32> = (0..skin.len() as u32).collect();
    fn find(root: &mut [u32], mut v: u32) -> u32 {
        while root[v as usize] != v {
            root[v as usize] = root[root[v as usize] as usize];
            v = root[v as usize];
        }
        v
    }
    for t in triangles {
        let a = find(&mut root, t[0]);
        for v in &t[1..] {
            let b = find(&mut root, *v);
            root[b as usize] = a;
        }
    }
    let mut parts: Vec<u32> = triangles.iter().map(|t| find(&mut root, t[0])).collect();
    parts.sort_unstable();
    parts.dedup();
    let outside = parts.into_iter().find(|v| tree.winding(cage, &skin[*v as usize]) != 1)?;
    let near = tree.nearest(cage, &skin[outside as usize])?;
    Some(tree.triangles()[near.triangle][0])
}

/// No quad is kept that a diagonal cuts into triangles with a smaller angle, in degrees.
const NARROW: f64 = 6.0;

/// Whether a quad may also be split by its other diagonal, `clear` of the skin. `pieces`: its two
/// triangles; `tree`: of the skin.
pub(crate) fn splits_either_way(
    pieces: &[[u32; 3]],
    cage: &[Point],
    faces: &[[u32; 3]],
    (skin, triangles): (&[Point], &[[u32; 3]]),
    (tree, clear): (&Bvh, f64),
) -> bool {
    let [[a, b, c], [_, _, d]] = pieces else { return false };
    let outer = [[*b, *c, *d], [*b, *d, *a]];
    let own = Bvh::new(cage, &outer);
    let fits = |t: &[u32; 3]| {
        let corners = t.map(|v| cage[v as usize]);
        let [p, q, r] = &corners;
        let mut fits = least_angle(corners) >= NARROW
            && faces.iter().all(|f| {
                let of_quad = f.iter().all(|v| [*a, *b, *c, *d].contains(v));
                of_quad || !neighbours_touch(cage, *t, *f)
            });
        let margin = Point::repeat(clear);
        tree.in_box(&(p.inf(q).inf(r) - margin), &(p.sup(q).sup(r) + margin), |at| {
            let corners = triangles[at as usize].map(|v| &skin[v as usize]);
            let near = |x: &&Point| own.nearest(cage, x).is_some_and(|n| n.distance < clear);
            fits = fits && !corners.iter().any(near) && !triangles_touch([p, q, r], corners);
        });
        fits
    };
    outer.iter().all(fits) && edge_is_clear([&cage[*b as usize], &cage[*d as usize]], skin, tree, clear)
}

/// Whether no point of an edge is nearer to the skin than `clear`. Each step is as long as the gap
/// allows.
fn edge_is_clear([p, q]: [&Point; 2], skin: &[Point], tree: &Bvh, clear: f64) -> bool {
    let (way, mut t) = (q - p, 0.0);
    let length = way.norm().max(1e-300);
    while t < 1.0 {
        let gap = tree.nearest(skin, &(p + way * t)).map_or(f64::INFINITY, |n| n.distance) - clear;
        if gap < 0.0 {
            return false;
        }
        t += gap.max(0.01 * clear) / length;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::{CagingOptions, Generator, Placement, Skin};
    use crate::fixtures::shapes::{icosphere, torus};
    use crate::progress::Progress;

    #[test]
    fn an_edge_past_a_ball_is_clear_by_its_distance() {
        let (skin, triangles) = ball(1.0, 0.0);
        let tree = Bvh::new(&skin, &triangles);
        let ends = [Point::new(-2.0, 1.1, 0.0), Point::new(2.0, 1.1, 0.0)];
        assert!(edge_is_clear([&ends[0], &ends[1]], &skin, &tree, 0.05));
        assert!(!edge_is_clear([&ends[0], &ends[1]], &skin, &tree, 0.25));
    }

    fn ball(radius: f64, shift: f64) -> (Vec<Point>, Vec<[u32; 3]>) {
        let (points, triangles) = icosphere(1);
        let points = points.iter().map(|p| p * radius + Point::x() * shift).collect();
        (points, triangles.iter().map(|t| t.map(|v| v as u32)).collect())
    }

    #[test]
    fn only_a_ball_around_the_ball_is_valid() {
        let (skin, triangles) = ball(1.0, 0.0);
        let check = |radius: f64, shift: f64| {
            let (cage, faces) = ball(radius, shift);
            fault(&cage, &faces, &skin, &triangles).map(|f| f.what)
        };
        assert_eq!(check(1.5, 0.0), None);
        assert_eq!(check(1.5, 0.7), Some("it does not enclose the skin"));
        assert_eq!(check(1.5, 9.0), Some("it does not enclose the skin"));
        assert_eq!(check(0.5, 0.0), Some("it does not enclose the skin"));
        assert_eq!(check(1.0, 0.0), Some("it does not enclose the skin"));
        let (cage, mut faces) = ball(1.5, 0.0);
        faces.iter_mut().for_each(|f| f.swap(0, 1));
        assert_eq!(fault(&cage, &faces, &skin, &triangles).map(|f| f.what), Some("it is inside out"));
    }

    #[test]
    fn a_ring_gets_a_cage_with_a_hole() {
        let (vertices, faces) = torus(48, 16, 1.0, 0.3);
        let turn = |k: usize| (k as f64 * std::f64::consts::TAU / 12.0).sin_cos();
        let nodes: Vec<Point> = (0..12).map(turn).map(|(s, c)| Point::new(c, s, 0.0)).collect();
        let edges: Vec<[i64; 2]> = (0..12).map(|k| [k, (k + 1) % 12]).collect();
        let options =
            CagingOptions { triangles: true, placement: Placement::Joints, ..CagingOptions::default() };
        let generator = Generator::new(&vertices, &faces, &nodes, &edges, options).expect("a loop");
        let made = generator.generate(None, None, &Progress::default().whole()).expect("a cage");
        let (points, count) = (made.vertices, made.faces.sizes.len());
        assert_eq!(count, 2 * points.len(), "2 C - 4 + 4 g faces, g = 1");
        assert!(points.len() > 4 * 4);
        let corner = |k: &i64| *k as u32;
        let triangles: Vec<[u32; 3]> =
            made.faces.corners.chunks(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect();
        let skin = Skin::new(&vertices, &faces).expect("closed");
        assert_eq!(fault(&points, &triangles, &skin.original, &skin.triangles), None);
        // Said by hand as well: of one part, closed and consistently turned, with an outside in the hole.
        let mut sides: Vec<(u32, u32)> =
            triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]).collect();
        sides.sort_unstable();
        assert!(sides.windows(2).all(|w| w[0] != w[1]));
        assert!(sides.iter().all(|(a, b)| sides.binary_search(&(*b, *a)).is_ok()));
        let tree = Bvh::new(&points, &triangles);
        assert!(vertices.iter().all(|p| tree.winding(&points, p) == 1));
        assert_eq!(tree.winding(&points, &Point::new(1e-3, 2e-3, 3e-3)), 0, "the hole is closed");
    }
}
