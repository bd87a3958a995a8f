//! Fixtures made in code: a bar in a box, a bumpy ball in a ball, and two awkward ones.

use super::Fixture;
use cage_rig::{Point, Polygons, Rows};
use std::collections::HashMap;

/// A tube of square rings along x, ends closed, quads outward. `rings` are (x, half width).
pub fn square_tube(rings: &[(f64, f64)]) -> (Vec<Point>, Polygons) {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let points = rings.iter().flat_map(|&(x, w)| corners.map(|(y, z)| Point::new(x, w * y, w * z))).collect();
    let last = 4 * (rings.len() as i64 - 1);
    let mut quads: Vec<[i64; 4]> = vec![[3, 2, 1, 0], [last, last + 1, last + 2, last + 3]];
    for ring in 0..rings.len() as i64 - 1 {
        for k in 0..4 {
            let (a, b) = (4 * ring + k, 4 * ring + (k + 1) % 4);
            quads.push([a, b, b + 4, a + 4]);
        }
    }
    (points, Polygons { corners: quads.concat(), sizes: vec![4; quads.len()] })
}

/// A round tube of `radius` along x from 0 to `length`: rings of `about` corners as far apart as these,
/// ends closed, outward.
pub fn round_tube(length: f64, radius: f64, about: usize) -> (Vec<Point>, Polygons) {
    let gap = radius * std::f64::consts::TAU / about as f64;
    let rings = (length / gap).ceil() as usize + 1;
    let mut points = Vec::new();
    for ring in 0..rings {
        let x = length * ring as f64 / (rings - 1) as f64;
        let turn = |k: usize| (k as f64 * std::f64::consts::TAU / about as f64).sin_cos();
        points.extend((0..about).map(turn).map(|(s, c)| Point::new(x, radius * c, radius * s)));
    }
    let mut faces = Polygons::default();
    for ring in 0..rings - 1 {
        for k in 0..about {
            let at = |ring: usize, k: usize| (ring * about + k % about) as i64;
            faces.corners.extend([at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)]);
            faces.sizes.push(4);
        }
    }
    let last = (rings - 1) * about;
    faces.corners.extend((0..about).rev().map(|k| k as i64));
    faces.corners.extend((last..last + about).map(|k| k as i64));
    faces.sizes.extend([about; 2]);
    (points, faces)
}

/// A ring in the plane of x and y: `around` sections of `about` corners at `radius`, as thick as `tube`.
pub fn torus(around: usize, about: usize, radius: f64, tube: f64) -> (Vec<Point>, Polygons) {
    let turn = |k: usize, n: usize| (k as f64 * std::f64::consts::TAU / n as f64).sin_cos();
    let mut points = Vec::new();
    let mut corners = Vec::new();
    for i in 0..around {
        for k in 0..about {
            let ((s, c), (t, d)) = (turn(i, around), turn(k, about));
            points.push(Point::new(c * (radius + tube * d), s * (radius + tube * d), tube * t));
            let at = |i: usize, k: usize| ((i % around) * about + k % about) as i64;
            corners.extend([at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]);
        }
    }
    let sizes = vec![4; around * about];
    (points, Polygons { corners, sizes })
}

/// An icosahedron split `level` times, on the unit sphere, outward.
pub fn icosphere(level: usize) -> (Vec<Point>, Vec<[i64; 3]>) {
    let g = (1.0 + 5.0f64.sqrt()) / 2.0;
    let mut points: Vec<Point> = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        points.push(Point::new(a, b, 0.0).normalize());
    }
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        points.push(Point::new(0.0, a, b).normalize());
    }
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        points.push(Point::new(b, 0.0, a).normalize());
    }
    let mut triangles: Vec<[i64; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middles = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |p: i64, q: i64| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push((points[p as usize] + points[q as usize]).normalize());
                    points.len() as i64 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (points, triangles)
}

/// The bar of [CTL*20] Figure 5: three joints along it, smooth weights.
pub fn bar() -> Fixture {
    let rings: Vec<(f64, f64)> = (0..=60).map(|i| (i as f64 / 6.0, 0.6)).collect();
    let (skin, skin_faces) = square_tube(&rings);
    let (cage, cage_faces) =
        square_tube(&[(-0.5, 0.9), (1.9, 1.0), (3.4, 1.1), (5.1, 1.0), (6.8, 1.1), (8.3, 1.0), (10.5, 0.9)]);
    let joints: Vec<Point> = [0.2, 3.4, 6.7].map(|x| Point::new(x, 0.0, 0.0)).to_vec();
    let mut weights = Rows::zeros(skin.len(), 3);
    for (i, p) in skin.iter().enumerate() {
        let step = |at: f64| 1.0 / (1.0 + (-(p.x - at) / 0.4).exp());
        let (first, second) = (step(3.4), step(6.7));
        weights.row_mut(i).copy_from_slice(&[1.0 - first, first * (1.0 - second), first * second]);
    }
    Fixture { name: "bar", skin, skin_faces, weights, joints, parents: vec![-1, 0, 1], cage, cage_faces }
}

/// A bumpy ball in an icosphere: two roots, joints listed children first, a bone without weights,
/// a patch of the skin without weights.
pub fn blob() -> Fixture {
    let (sphere, triangles) = icosphere(3);
    let bump = |p: &Point| 0.8 + 0.1 * (4.0 * p.x).sin() * (3.0 * p.y).cos() + 0.05 * (5.0 * p.z).sin();
    let skin: Vec<Point> = sphere.iter().map(|p| p * bump(p)).collect();
    let (mut cage, cage_triangles) = icosphere(1);
    cage.iter_mut().for_each(|c| *c *= 1.25 + 0.1 * (3.0 * c.x).sin());
    let joints: Vec<Point> =
        [[0.3, 0.3, 0.2], [-0.4, 0.1, 0.0], [0.1, 0.0, 0.0], [0.0, -0.3, 0.3], [0.0, 0.5, 0.0]]
            .map(Point::from)
            .to_vec();
    let mut weights = Rows::zeros(skin.len(), 5);
    for (i, p) in skin.iter().enumerate().filter(|(_, p)| p.z > -0.6) {
        for (weight, joint) in weights.row_mut(i).iter_mut().zip(&joints[..4]) {
            *weight = (-4.0 * (p - joint).norm_squared()).exp();
        }
    }
    Fixture {
        name: "blob",
        skin,
        skin_faces: Polygons::from_triangles(&triangles),
        weights,
        joints,
        parents: vec![2, 2, -1, -1, 0],
        cage,
        cage_faces: Polygons::from_triangles(&cage_triangles),
    }
}

/// Eight skin vertices in a cage of 42.
pub fn more_cage_than_skin() -> Fixture {
    let (skin, skin_faces) = square_tube(&[(-0.4, 0.4), (0.4, 0.3)]);
    let (mut cage, cage_triangles) = icosphere(1);
    cage.iter_mut().for_each(|c| *c *= 1.5);
    let weights = Rows::from_vec(8, 2, [0.9, 0.1, 0.2, 0.8].iter().cycle().take(16).copied().collect());
    Fixture {
        name: "more cage than skin",
        skin,
        skin_faces,
        weights: weights.expect("sixteen numbers"),
        joints: vec![Point::new(-0.2, 0.0, 0.0), Point::new(0.2, 0.0, 0.1)],
        parents: vec![-1, 0],
        cage,
        cage_faces: Polygons::from_triangles(&cage_triangles),
    }
}

/// The bar, in a cage with two rings far beyond its end that hardly touch it.
pub fn far_vertex() -> Fixture {
    let (cage, cage_faces) = square_tube(&[
        (-0.5, 0.9),
        (1.9, 1.0),
        (3.4, 1.1),
        (5.1, 1.0),
        (6.8, 1.1),
        (8.3, 1.0),
        (10.5, 0.9),
        (40.0, 0.4),
        (60.0, 0.4),
    ]);
    Fixture { name: "far vertex", cage, cage_faces, ..bar() }
}

/// The bar, of which a cage encloses the last third alone.
pub fn partly_caged() -> Fixture {
    let (cage, cage_faces) = square_tube(&[(5.6, 0.9), (6.8, 1.0), (8.3, 1.0), (10.5, 0.9)]);
    Fixture { name: "partly caged", cage, cage_faces, ..bar() }
}
