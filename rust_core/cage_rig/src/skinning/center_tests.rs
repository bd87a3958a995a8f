//! Centers of rotation against the plain integral, and what they must be.

use super::centers::{centers, CenterOptions};
use super::naive::{center, normalised};
use super::PackedWeights;
use crate::fixtures::{self, arm, Fixture};
use crate::mesh::{triangulate, Polygons};
use crate::points::{to_f32, Point};
use crate::progress::unwatched;
use crate::rows::Rows;
use crate::weights::SkinWeights;

fn triangles(fixture: &Fixture) -> Vec<[u32; 3]> {
    let pieces = triangulate(&fixture.skin, &fixture.skin_faces).ok().expect("valid faces");
    pieces.iter().map(|piece| piece.corners).collect()
}

fn positions(fixture: &Fixture) -> Rows {
    let numbers = fixture.skin.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    Rows::from_vec(fixture.skin.len(), 3, numbers).expect("three a vertex")
}

fn found(fixture: &Fixture, values: &Rows, bins: u32) -> Rows {
    let weights = PackedWeights::new(&SkinWeights::from_dense(&fixture.weights).expect("valid weights"));
    let options = CenterOptions { bins, ..CenterOptions::default() };
    let (skin, triangles) = (to_f32(&fixture.skin), triangles(fixture));
    unwatched(|part| centers(&skin, &triangles, &weights, values, &options, part))
}

/// Mean and largest error over the spread of what moves alike, of every seventh vertex.
fn errors(fixture: &Fixture, bins: u32) -> (f64, f64) {
    let found = found(fixture, &positions(fixture), bins);
    let (triangles, weights) = (triangles(fixture), normalised(&fixture.weights));
    let errors: Vec<f64> = (0..fixture.skin.len())
        .step_by(7)
        .filter_map(|i| center(&fixture.skin, &triangles, &weights, i, 0.1).map(|c| (i, c)))
        .filter(|(_, (_, spread))| *spread > 1e-6)
        .map(|(i, (p, spread))| (Point::from_row_slice(found.row(i)) - p).norm() / spread)
        .collect();
    (errors.iter().sum::<f64>() / errors.len() as f64, errors.iter().copied().fold(0.0, f64::max))
}

/// A tube of 40 rings of 24 along x, seven bones along it, each vertex under four of them.
fn snake() -> Fixture {
    let (rings, around, joints) = (40, 24, 7);
    let mut skin = Vec::new();
    let mut weights = Rows::zeros(rings * around, joints);
    for i in 0..rings * around {
        let (x, turn) = ((i / around) as f64 / 4.0, (i % around) as f64 * 15.0);
        let (sin, cos) = turn.to_radians().sin_cos();
        skin.push(Point::new(x, cos, sin));
        for j in 0..joints {
            let apart = x - 1.6 * j as f64 + 0.2 * cos;
            weights.row_mut(i)[j] = if apart.abs() < 3.2 { (-apart * apart).exp() } else { 0.0 };
        }
    }
    let quads = (0..(rings - 1) * around).map(|i| {
        let next = i - i % around + (i + 1) % around;
        [i, next, next + around, i + around].map(|v| v as i64)
    });
    let corners: Vec<i64> = quads.flatten().collect();
    let skin_faces = Polygons { sizes: vec![4; corners.len() / 4], corners };
    Fixture { name: "snake", skin, skin_faces, weights, ..fixtures::shapes::bar() }
}

fn rigs() -> Vec<Fixture> {
    let mut rigs = vec![fixtures::shapes::bar(), fixtures::shapes::blob(), snake()];
    if arm::is_here() {
        rigs.push(arm::fixture());
    }
    rigs
}

#[test]
fn without_bins_centers_are_the_plain_integral() {
    for fixture in rigs() {
        let (_, worst) = errors(&fixture, 0);
        assert!(worst <= 1e-5, "{}: {worst:e}", fixture.name);
    }
}

#[test]
fn bins_cost_less_than_half_a_percent_of_what_moves_alike() {
    let bins = CenterOptions::default().bins;
    for fixture in rigs() {
        let (mean, worst) = errors(&fixture, bins);
        assert!(mean <= 5e-4 && worst <= 5e-3, "{}: {mean:e} {worst:e}", fixture.name);
        let (coarse, _) = errors(&fixture, bins / 4);
        assert!(mean <= coarse, "{}", fixture.name);
    }
}

#[test]
fn vertices_of_one_bone_none_or_without_area_are_their_own_centers() {
    for mut fixture in rigs() {
        let own = positions(&fixture);
        let centers = found(&fixture, &own, 32);
        for i in 0..own.len() {
            if fixture.weights.row(i).iter().filter(|w| **w > 0.0).count() < 2 {
                assert_eq!(centers.row(i), own.row(i));
            }
        }
        fixture.skin_faces = Polygons::default();
        assert_eq!(found(&fixture, &own, 32), own);
    }
}

#[test]
fn centers_of_an_elbow_lie_on_its_axis() {
    let fixture = snake();
    for bins in [0, 32] {
        let centers = found(&fixture, &positions(&fixture), bins);
        for i in 0..fixture.skin.len() {
            let [_, y, z] = centers.row(i) else { unreachable!("three columns") };
            // The weights lean along y, so the middle of what moves alike may too.
            assert!(z.abs() < 0.02 && y.abs() < 0.5, "{i}: {y} {z}");
        }
    }
}

#[test]
fn integrating_coordinates_gives_the_coordinates_of_the_centers() {
    // The snake has no cage of its own.
    for fixture in rigs().into_iter().filter(|fixture| fixture.name != "snake") {
        let cage = fixture.cage();
        let coords = fixture.rig().cage_coords().clone();
        let lambda = found(&fixture, &coords, 32);
        let direct = found(&fixture, &positions(&fixture), 32);
        for i in 0..lambda.len() {
            assert!((lambda.row(i).iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let center = lambda.combine(i, cage.vertices());
            let direct = Point::from_row_slice(direct.row(i));
            assert!((center - direct).norm() < 1e-6 * fixture.size(), "{} {i}", fixture.name);
        }
    }
}
