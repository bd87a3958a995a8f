//! What every kind of coordinates must do, by being in the table.

use super::lanes::Weigh;
use super::mean_value::Surface;
use super::naive::ORACLES;
use super::{kind, CoordinateKind, KINDS};
use crate::cage::Cage;
use crate::fixtures::{self, arm, random::Random};
use crate::points::{bounding_diagonal, Point};
use crate::progress::{unwatched, Cancelled, Progress};
use crate::rows::Rows;
use crate::simd::Path;

fn compute(kind: &CoordinateKind, cage: &Cage, points: &[Point]) -> Rows {
    unwatched(|part| (kind.compute)(cage, points, part))
}

/// Sums and linear precision of `rows` at `points`, relative to the size of the cage.
fn assert_precise(rows: &Rows, cage: &Cage, points: &[Point], tolerance: f64, what: &str) {
    let size = bounding_diagonal(cage.vertices());
    for (i, point) in points.iter().enumerate() {
        let row = rows.row(i);
        assert!(row.iter().all(|w| w.is_finite()), "{what}: not finite at {point}");
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{what}: the sum at {point}");
        let miss = (rows.combine(i, cage.vertices()) - point).norm() / size;
        assert!(miss <= tolerance, "{what}: misses {point} by {miss:e}");
    }
}

fn points_around(cage: &Cage, count: usize, seed: u64) -> Vec<Point> {
    let mut random = Random::new(seed);
    (0..count).map(|_| random.point() * 0.6 * bounding_diagonal(cage.vertices())).collect()
}

#[test]
fn rows_sum_to_one_and_reproduce_their_point_inside_and_outside() {
    for kind in KINDS {
        for fixture in fixtures::all() {
            let cage = fixture.cage();
            assert_precise(&compute(kind, &cage, &fixture.skin), &cage, &fixture.skin, 1e-13, fixture.name);
            let points = points_around(&cage, 300, 1);
            assert_precise(&compute(kind, &cage, &points), &cage, &points, 1e-13, fixture.name);
        }
    }
}

#[test]
fn every_kind_agrees_with_its_oracle() {
    for kind in KINDS {
        let oracle = ORACLES.iter().find(|(name, _)| *name == kind.name).expect("every kind has an oracle").1;
        for fixture in fixtures::all() {
            let cage = fixture.cage();
            let rows = compute(kind, &cage, &fixture.skin);
            for (i, point) in fixture.skin.iter().enumerate().step_by(7) {
                let expected = oracle(&cage, point);
                let worst = rows.row(i).iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-9, "{} {}: {worst:e} at {point}", kind.name, fixture.name);
            }
        }
    }
}

/// Points at 0 and 1e-12…1e-3 of the size from a place, along some directions.
fn sweep(place: Point, directions: &[Point], size: f64) -> Vec<Point> {
    let steps = (0..=9).map(|k| 10f64.powi(-12 + k)).chain([0.0, 3e-13, 1e-15]);
    steps.flat_map(|step| directions.iter().map(move |d| place + d.normalize() * step * size)).collect()
}

#[test]
fn on_and_near_vertices_edges_and_faces_rows_stay_precise() {
    let mut random = Random::new(2);
    for kind in KINDS {
        for fixture in fixtures::all() {
            let cage = fixture.cage();
            let size = bounding_diagonal(cage.vertices());
            for triangle in cage.triangles() {
                let [a, b, c] = triangle.map(|v| cage.vertices()[v as usize]);
                let normal = (b - a).cross(&(c - a));
                let along = random.between(0.1, 0.9);
                let directions = [normal, -normal, a - b, c - a, random.point(), random.point()];
                let places =
                    [a, a + (b - a) * along, (a + b + c) / 3.0, a + (b - a) * 1e-7 + (c - a) * along];
                let points: Vec<Point> = places.iter().flat_map(|p| sweep(*p, &directions, size)).collect();
                assert_precise(&compute(kind, &cage, &points), &cage, &points, 1e-12, fixture.name);
            }
        }
    }
}

#[test]
fn in_the_plane_of_a_face_or_on_the_line_of_an_edge_rows_are_continuous() {
    let mut random = Random::new(3);
    for kind in KINDS {
        let fixture = fixtures::shapes::bar();
        let cage = fixture.cage();
        let size = bounding_diagonal(cage.vertices());
        for triangle in cage.triangles() {
            let [a, b, c] = triangle.map(|v| cage.vertices()[v as usize]);
            let normal = (b - a).cross(&(c - a)).normalize();
            // Beyond the edge bc, in the plane; and on the line ab, beyond b.
            for place in [a + (b - a) * 1.3 + (c - a) * 1.1, a + (b - a) * 1.7] {
                let offset = normal + random.point() * 0.3;
                let steps: [f64; 7] = [0.0, 1e-14, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8];
                let points = steps.map(|step| place + offset * step * size);
                let rows = compute(kind, &cage, &points);
                for (i, step) in steps.iter().enumerate() {
                    let change =
                        rows.row(i).iter().zip(rows.row(0)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                    assert!(change < 1e-9 + 100.0 * step, "{change:e} at {step:e} from {place}");
                }
            }
        }
    }
}

/// The row of `point` face by face, each seen closely.
fn seen_closely(surface: &Surface, point: &Point) -> Vec<f64> {
    let (row, _) = surface.seen_closely(point);
    let sum: f64 = row.iter().sum();
    row.iter().map(|w| w / sum).collect()
}

#[test]
fn all_instructions_give_the_rows_of_faces_seen_closely() {
    for fixture in fixtures::all() {
        let cage = fixture.cage();
        let surface = Surface::new(cage.vertices(), cage.triangles());
        // An odd number of them, so that some lanes are left over.
        let points: Vec<Point> =
            points_around(&cage, 100, 7).into_iter().chain(fixture.skin).take(333).collect();
        let expected: Vec<f64> = points.iter().flat_map(|point| seen_closely(&surface, point)).collect();
        for path in Path::available() {
            let mut rows = vec![0.0; expected.len()];
            let (progress, mut done) = (Progress::default(), Ok(()));
            let part = &progress.whole();
            let (surface, points, rows_of) = (&surface, &points, &mut rows);
            path.run(Weigh { surface, points, correction: None, rows: rows_of, part, done: &mut done });
            let worst = rows.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-11, "{} {}: {worst:e}", fixture.name, path.name());
        }
    }
}

#[test]
fn pieces_of_a_mesh_weigh_as_much_as_the_whole_and_each_looks_for_a_cancel() {
    let (vertices, triangles) = fixtures::shapes::icosphere(4);
    let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| v as u32)).collect();
    let surface = Surface::new(&vertices, &triangles);
    assert!(surface.patches.len() >= 10);
    assert!(surface.patches.iter().all(|patch| patch.faces.len() <= 512));
    assert_eq!(surface.patches.iter().map(|patch| patch.faces.len()).sum::<usize>(), triangles.len());
    let point = Point::new(0.3, -0.2, 0.4);
    let mut row = vec![0.0; vertices.len()];
    let progress = Progress::default();
    surface.weights(&[point], &mut row, &progress.whole()).expect("nobody cancels");
    let worst =
        row.iter().zip(seen_closely(&surface, &point)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-14, "{worst:e}");
    progress.cancel();
    assert_eq!(surface.weights(&[point], &mut row, &progress.whole()), Err(Cancelled));
}

#[test]
fn at_a_cage_vertex_only_that_vertex_counts() {
    for kind in KINDS {
        let cage = fixtures::shapes::blob().cage();
        let rows = compute(kind, &cage, cage.vertices());
        for k in 0..rows.len() {
            assert!(rows
                .row(k)
                .iter()
                .enumerate()
                .all(|(i, w)| (w - f64::from(u8::from(i == k))).abs() < 1e-14));
        }
    }
}

#[test]
fn an_unknown_kind_is_refused_with_the_known_ones() {
    let message = kind("green").map(|_| ()).expect_err("not there yet").to_string();
    assert!(message.contains("green") && message.contains("mean_value"), "{message}");
}

#[test]
fn mean_value_equals_the_reference_on_the_arm() {
    if !arm::is_here() {
        return;
    }
    let fixture = arm::fixture();
    let cage = fixture.cage();
    let rows = compute(&KINDS[0], &cage, &fixture.skin);
    let reference = arm::open("bind").rows("Phi");
    let worst =
        rows.as_slice().iter().zip(reference.as_slice()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst <= 1e-9, "{worst:e}");
    assert!(fixtures::distance(&rows.times(cage.vertices()), &fixture.skin) <= 1e-9);
}
