//! Every refusal of a cage, each by what and where; and what is accepted.

mod common;

use cage_rig::{Cage, CageError, Point, Polygons};
use common::shapes::{icosphere, square_tube};

fn ball() -> (Vec<Point>, Vec<[i64; 3]>) {
    icosphere(0)
}

fn check(points: &[Point], triangles: &[[i64; 3]]) -> Result<Cage, CageError> {
    Cage::new(points.to_vec(), &Polygons::from_triangles(triangles))
}

#[test]
fn closed_balls_and_boxes_are_cages() {
    let (points, triangles) = ball();
    let cage = check(&points, &triangles).expect("a closed ball");
    assert!(!cage.turned());
    let (points, quads) = square_tube(&[(0.0, 1.0), (2.0, 1.0)]);
    let cage = Cage::new(points, &quads).expect("a closed box");
    assert_eq!((cage.turned(), cage.triangles().len()), (false, 12));
}

#[test]
fn a_cage_inside_out_as_a_whole_is_turned() {
    let (points, mut triangles) = ball();
    let expected = check(&points, &triangles).expect("a closed ball");
    triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let cage = check(&points, &triangles).expect("a closed ball");
    assert!(cage.turned());
    let volume = |cage: &Cage| -> f64 {
        let corner = |v: u32| cage.vertices()[v as usize];
        cage.triangles().iter().map(|t| corner(t[0]).dot(&corner(t[1]).cross(&corner(t[2])))).sum()
    };
    assert!((volume(&cage) - volume(&expected)).abs() < 1e-12);
}

#[test]
fn two_closed_parts_are_one_cage() {
    let (points, triangles) = two_balls();
    assert!(check(&points, &triangles).is_ok());
}

fn two_balls() -> (Vec<Point>, Vec<[i64; 3]>) {
    let (mut points, mut triangles) = ball();
    let other: Vec<Point> = points.iter().map(|p| p + Point::new(5.0, 0.0, 0.0)).collect();
    let shifted: Vec<[i64; 3]> = triangles.iter().map(|t| t.map(|v| v + 12)).collect();
    points.extend(other);
    triangles.extend(shifted);
    (points, triangles)
}

#[test]
fn a_part_inside_out_against_the_rest_is_refused() {
    let (points, mut triangles) = two_balls();
    triangles[20..].iter_mut().for_each(|t| t.swap(1, 2));
    triangles.iter_mut().for_each(|t| t.rotate_left(1));
    assert!(matches!(check(&points, &triangles), Err(CageError::InsideOutPart { .. } | CageError::NoVolume)));
}

#[test]
fn a_flipped_face_is_refused_by_its_index() {
    let (points, mut triangles) = ball();
    triangles[7].swap(0, 1);
    assert_eq!(check(&points, &triangles).err(), Some(CageError::FlippedFace { face: 7, count: 1 }));
    let (points, mut quads) = square_tube(&[(0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]);
    quads.corners[12..16].reverse();
    assert_eq!(Cage::new(points, &quads).err(), Some(CageError::FlippedFace { face: 3, count: 1 }));
}

#[test]
fn a_hole_is_refused_by_one_of_its_edges() {
    let (points, mut triangles) = ball();
    triangles.remove(4); // 0 10 11
    assert!(matches!(check(&points, &triangles), Err(CageError::OpenEdge { a: 0, b: 10, .. })));
}

#[test]
fn an_edge_of_three_faces_is_refused() {
    let (points, mut triangles) = ball();
    triangles.push([0, 11, 3]);
    assert!(matches!(
        check(&points, &triangles),
        Err(CageError::NonManifoldEdge { a: 0, b: 11, count: 3 } | CageError::OpenEdge { .. })
    ));
    triangles.push([0, 11, 3]);
    assert_eq!(check(&points, &triangles).err(), Some(CageError::NonManifoldEdge { a: 0, b: 11, count: 4 }));
}

#[test]
fn two_parts_that_share_a_vertex_are_refused_there() {
    let (points, mut triangles) = two_balls();
    triangles[20..].iter_mut().flatten().for_each(|v| *v = if *v == 14 { 5 } else { *v });
    let mut kept = points.clone();
    kept.remove(14);
    triangles.iter_mut().flatten().for_each(|v| *v -= i64::from(*v > 14));
    assert_eq!(check(&kept, &triangles).err(), Some(CageError::NonManifoldVertex { vertex: 5, fans: 2 }));
}

#[test]
fn a_klein_bottle_is_refused_as_one_sided() {
    // A 4 by 4 grid glued to a torus with one direction reversed.
    let points: Vec<Point> =
        (0..16).map(|i| Point::new((i as f64).sin(), (2.0 * i as f64).cos(), i as f64)).collect();
    let at = |i: i64, k: i64| {
        let (i, k) = if i == 4 { (0, (4 - k) % 4) } else { (i, k % 4) };
        4 * i + k
    };
    let mut triangles = Vec::new();
    for i in 0..4 {
        for k in 0..4 {
            triangles.push([at(i, k), at(i + 1, k), at(i + 1, k + 1)]);
            triangles.push([at(i, k), at(i + 1, k + 1), at(i, k + 1)]);
        }
    }
    assert!(matches!(check(&points, &triangles), Err(CageError::NotOrientable { .. })));
}

#[test]
fn malformed_faces_and_vertices_are_refused_by_index() {
    let (points, triangles) = ball();
    let with_face = |face: usize, corners: [i64; 3]| {
        let mut triangles = triangles.clone();
        triangles[face] = corners;
        check(&points, &triangles).err()
    };
    assert_eq!(with_face(3, [0, 7, 12]), Some(CageError::BadIndex { face: 3, vertex: 12, vertices: 12 }));
    assert_eq!(with_face(3, [0, -1, 10]), Some(CageError::BadIndex { face: 3, vertex: -1, vertices: 12 }));
    assert_eq!(with_face(3, [0, 7, 7]), Some(CageError::RepeatedCorner { face: 3, vertex: 7 }));
    let two_corners = Polygons { corners: vec![0, 1, 0, 1, 0, 1, 0, 1], sizes: vec![2; 4] };
    assert_eq!(
        Cage::new(points.clone(), &two_corners).err(),
        Some(CageError::FewCorners { face: 0, corners: 2 })
    );
    assert_eq!(check(&points[..3], &triangles).err(), Some(CageError::TooSmall { vertices: 3, faces: 20 }));
    let with_vertex = |vertex: usize, place: Point| {
        let mut points = points.clone();
        points[vertex] = place;
        check(&points, &triangles).err()
    };
    let nan = Point::new(0.0, f64::NAN, 0.0);
    assert_eq!(with_vertex(6, nan), Some(CageError::NotFinite { vertex: 6 }));
    assert_eq!(with_vertex(6, points[2]), Some(CageError::CoincidentVertices { first: 2, second: 6 }));
    let mut more = points.clone();
    more.push(Point::zeros());
    assert_eq!(check(&more, &triangles).err(), Some(CageError::UnusedVertex { vertex: 12 }));
}

#[test]
fn a_face_without_area_is_refused() {
    let (points, mut triangles) = ball();
    // Split edge 0–11 at its middle on one side only in shape: the new faces are closed but flat.
    let mut points = points;
    points.push((points[0] + points[11]) / 2.0);
    triangles.push([0, 12, 11]);
    let face = triangles.iter().position(|t| *t == [0, 11, 5]).expect("a face of the ball");
    triangles[face] = [0, 12, 5];
    triangles.push([12, 11, 5]);
    assert!(matches!(check(&points, &triangles), Err(CageError::DegenerateFace { face: 20 })));
}

#[test]
fn a_flat_cage_has_no_volume() {
    let (points, quads) = square_tube(&[(0.0, 1.0), (2.0, 1.0), (4.0, 1.5)]);
    let flat: Vec<Point> =
        points.iter().enumerate().map(|(i, p)| Point::new(p.x, p.y + 0.01 * i as f64, 0.0)).collect();
    let error = Cage::new(flat, &quads).err();
    assert!(matches!(error, Some(CageError::NoVolume | CageError::DegenerateFace { .. })), "{error:?}");
}
