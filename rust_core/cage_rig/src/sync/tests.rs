//! The parts of the cycle against their oracles and the reference.

use super::cage_reverser::CageReverser;
use super::cage_updater::CageUpdater;
use super::joint_coordinates::SkinAtRest;
use super::maxvol::{self, MaxVol, MaxVolOptions};
use super::naive::{hierarchy, linear_parts, reverse_matrix, translation_gradient};
use super::skeleton_updater::SkeletonUpdater;
use crate::cage::Cage;
use crate::coordinates::mean_value;
use crate::fixtures::{self, arm, Fixture};
use crate::linalg::Lu;
use crate::points::Point;
use crate::progress::unwatched;
use crate::rows::Rows;
use crate::skeleton::Skeleton;
use crate::weights::SkinWeights;

fn coordinates(cage: &Cage, points: &[Point]) -> Rows {
    unwatched(|part| mean_value::coordinates(cage, points, part))
}

fn maxvol(coords: &Rows) -> MaxVol {
    unwatched(|part| maxvol::maxvol(coords, &MaxVolOptions::default(), part))
}

fn cage_updater(anchors: &[usize], skin: &SkinAtRest, cage: &[Point], min_singular: f64) -> CageUpdater {
    unwatched(|part| CageUpdater::new(anchors, skin, cage, min_singular, part))
}

fn largest_difference(a: &Rows, b: &Rows) -> f64 {
    assert_eq!((a.len(), a.columns()), (b.len(), b.columns()));
    a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn skeleton(fixture: &Fixture) -> Skeleton {
    Skeleton::new(fixture.joints.clone(), &fixture.parents).expect("a valid skeleton")
}

fn at_rest<'a>(fixture: &'a Fixture, cage_coords: &'a Rows, weights: &'a SkinWeights) -> SkinAtRest<'a> {
    let reach = &[1.0; 1000][..fixture.skin.len()];
    SkinAtRest { vertices: &fixture.skin, triangles: &[], weights, cage_coords, reach }
}

fn whole(joints: usize) -> Vec<f64> {
    vec![1.0; joints]
}

fn parts(fixture: &Fixture) -> (CageUpdater, SkeletonUpdater) {
    parts_attenuated(fixture, 1e-3)
}

fn parts_attenuated(fixture: &Fixture, limit: f64) -> (CageUpdater, SkeletonUpdater) {
    let cage = fixture.cage();
    let coords = coordinates(&cage, &fixture.skin);
    let anchors = maxvol(&coords).rows;
    let weights = SkinWeights::from_dense(&fixture.weights).expect("valid weights");
    let joint_coords = fixture.rig().joint_coords().clone();
    let cage_updater = cage_updater(&anchors, &at_rest(fixture, &coords, &weights), cage.vertices(), limit);
    (cage_updater, SkeletonUpdater::new(skeleton(fixture), joint_coords))
}

#[test]
fn the_walk_down_the_hierarchy_equals_the_inverted_matrix() {
    for fixture in fixtures::all() {
        let linear = linear_parts(&fixtures::lively_pose(&fixture, 1.0));
        let (_, updater) = parts(&fixture);
        let expected = translation_gradient(&skeleton(&fixture), &linear, updater.joint_coords());
        for (j, row) in updater.translation_gradient(&linear, &whole(linear.len())).iter().enumerate() {
            for (k, block) in row.iter().enumerate() {
                for (d, e) in (0..9).map(|n| (n / 3, n % 3)) {
                    assert!((block[(d, e)] - expected.row(3 * j + d)[3 * k + e]).abs() < 1e-12);
                }
            }
        }
    }
}

#[test]
fn the_reverser_solves_equation_19_as_printed() {
    let fixture = fixtures::shapes::bar();
    let linear = linear_parts(&fixtures::lively_pose(&fixture, 1.0));
    let (cage, updater) = parts(&fixture);
    assert_eq!(cage.attenuated(), 0);
    let gradient = translation_gradient(&skeleton(&fixture), &linear, updater.joint_coords());
    let system = reverse_matrix(&cage, &gradient, &linear);
    let step = fixtures::nudged(&vec![Point::zeros(); fixture.cage.len()], 1.0, 5);
    let expected = Lu::new(&system).solve_interleaved(&cage.anchor_coords().times(&step));
    let found = CageReverser::dense(&cage, &updater, &linear, &whole(linear.len()));
    let found = found.expect("a solvable pose").solve(&cage, &step);
    assert!(fixtures::distance(&found, &expected) < 1e-10);
}

#[test]
fn few_bent_joints_are_solved_by_low_rank_and_equal_the_dense_factors() {
    let (mut exact, mut attenuated) = (0, 0);
    for fixture in fixtures::all() {
        for limit in [1e-3, 0.02, 0.05, 0.1, 0.2] {
            let (cage, updater) = parts_attenuated(&fixture, limit);
            let shares: Vec<f64> = (0..fixture.joints.len()).map(|j| 1.0 - 0.1 * j as f64).collect();
            let mut linear = vec![fixtures::rotation(Point::new(0.3, 1.0, 0.2), 0.4); fixture.joints.len()];
            let last = linear.len() - 1;
            linear[last] = fixtures::rotation(Point::new(1.0, 0.1, 0.4), 0.9) * linear[last] * 1.1;
            let found = CageReverser::new(&cage, &updater, &linear, &shares).expect("a solvable pose");
            let dense = CageReverser::dense(&cage, &updater, &linear, &shares).expect("a solvable pose");
            assert!(!dense.is_low_rank());
            if !found.is_low_rank() {
                continue;
            }
            *if cage.attenuated() > 0 { &mut attenuated } else { &mut exact } += 1;
            let step = fixtures::nudged(&vec![Point::zeros(); fixture.cage.len()], 1.0, 5);
            let (found, expected) = (found.solve(&cage, &step), dense.solve(&cage, &step));
            let size = expected.iter().map(|p| p.norm()).fold(0.0, f64::max);
            assert!(fixtures::distance(&found, &expected) < 1e-9 * size, "{} {limit}", fixture.name);
        }
    }
    assert!(exact > 0 && attenuated > 0, "{exact} exact fits and {attenuated} attenuated ones by low rank");
}

#[test]
fn an_attenuated_fit_keeps_the_cage_near_the_skinned_one() {
    let fixture = fixtures::shapes::far_vertex();
    let (cage, updater) = parts(&fixture);
    assert!(cage.attenuated() > 0);
    assert!(cage.condition() > 1e3);
    let pose = fixtures::lively_pose(&fixture, 0.5);
    let (mut joints, mut motions) = (Vec::new(), Vec::new());
    updater.joints_into(&fixture.cage, &whole(fixture.joints.len()), &mut joints);
    updater.motions_into(&pose, &joints, &mut motions);
    let transforms = updater.transforms(&motions, &joints);
    let posed = cage.posed_cage(&fixture.cage, &transforms);
    assert!(fixtures::distance(&posed, &fixture.cage) < 5.0 * cage_size(&fixture));
    let rig = fixture.rig();
    let weights = SkinWeights::from_dense(&fixture.weights).expect("valid weights");
    let skin = at_rest(&fixture, rig.cage_coords(), &weights);
    let exact = cage_updater(rig.anchors(), &skin, &fixture.cage, 0.0);
    // Eq. (8) as printed throws the far rings away from the character.
    assert!(
        fixtures::distance(&exact.posed_cage(&fixture.cage, &transforms), &fixture.cage)
            > 100.0 * cage_size(&fixture)
    );
}

fn cage_size(fixture: &Fixture) -> f64 {
    crate::points::bounding_diagonal(&fixture.cage)
}

#[test]
fn anchors_are_distinct_and_no_row_depends_on_them_by_more_than_the_limit() {
    for fixture in fixtures::all() {
        let coords = coordinates(&fixture.cage(), &fixture.skin);
        let chosen = maxvol(&coords);
        let mut rows = chosen.rows.clone();
        rows.sort_unstable();
        rows.dedup();
        assert_eq!(rows.len(), fixture.skin.len().min(fixture.cage.len()), "{}", fixture.name);
        assert!(chosen.ratio <= 1.05, "{}: {}", fixture.name, chosen.ratio);
    }
}

#[test]
fn dependent_columns_leave_enough_distinct_anchors() {
    let mut coords = Rows::zeros(30, 5);
    let mut random = fixtures::random::Random::new(4);
    for i in 0..30 {
        let row = coords.row_mut(i);
        (row[0], row[1], row[3]) = (random.unit(), random.unit(), random.unit());
        row[4] = row[0] + row[1]; // and column 2 stays 0
    }
    let chosen = maxvol(&coords);
    let mut rows = chosen.rows.clone();
    rows.sort_unstable();
    rows.dedup();
    assert_eq!(rows.len(), 5);
    assert!(chosen.ratio <= 1.05);
}

#[test]
fn hierarchy_and_anchors_equal_the_reference_on_the_arm() {
    if !arm::is_here() {
        return;
    }
    let fixture = arm::fixture();
    let (turns, shape) = arm::open("poses").doubles("A_R");
    let poses = arm::open("poses").poses("T_skin");
    let topology = arm::open("bind").rows("Btopo");
    for (pose, turns) in poses.iter().zip(turns.chunks(shape[1] * shape[2])) {
        let (found_turns, found_topology) = hierarchy(&skeleton(&fixture), &linear_parts(pose));
        let turns = Rows::from_vec(shape[1], shape[2], turns.to_vec()).expect("a matrix a pose");
        assert!(largest_difference(&found_turns, &turns) < 1e-12);
        assert!(largest_difference(&found_topology, &topology) < 1e-12);
    }
    let coords = coordinates(&fixture.cage(), &fixture.skin);
    assert!(maxvol(&coords).ratio <= 1.05);
    let shipped: Vec<usize> = arm::anchors().iter().map(|&i| i as usize).collect();
    assert!((unwatched(|part| maxvol::ratio_of(&coords, &shipped, part)) - 1.00014).abs() < 1e-4);
}

#[test]
fn centers_of_rotation_move_with_the_cage() {
    for fixture in fixtures::all() {
        let method = crate::skinning::method("cor").expect("it is there");
        let input = crate::sync::BindInput { method, ..fixture.input() };
        let mut rig = crate::CoupledRig::new(input).expect("the fixture binds");
        let cage = fixtures::nudged(&fixture.cage, 0.1, 4);
        rig.play(&cage, &fixtures::lively_pose(&fixture, 0.8), None).expect("a valid frame");
        let moved: Vec<Point> = cage.iter().zip(&fixture.cage).map(|(c, c0)| c - c0).collect();
        let steps = rig.cage_coords().times(&moved);
        let rest: Vec<Point> = fixture.skin.iter().zip(&steps).map(|(v, d)| v + d).collect();
        // Eq. (14) as printed.
        let centers = rig.center_coords().expect("the method needs them").times(&cage);
        let weights = crate::skinning::naive::normalised(&fixture.weights);
        let expected = crate::skinning::naive::cor(rig.transforms(), &weights, &rest, &centers);
        let found = fixtures::points(rig.posed_skin());
        assert!(fixtures::distance(&found, &expected) <= 4e-6 * fixture.size(), "{}", fixture.name);
    }
}
