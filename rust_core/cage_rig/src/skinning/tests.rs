//! What every skinning method must do, by being in the table.

use super::naive::ORACLES;
use super::{method, PackedWeights, SkinningInput, SkinningMethod, METHODS};
use crate::fixtures::{self, arm, Fixture};
use crate::points::{to_f32, Point, Transform};
use crate::rows::Rows;
use crate::skinning::lbs::pose_points;
use crate::weights::SkinWeights;

/// The frame path must stay this near to double precision, relative to the size.
const FRAME: f64 = 2e-6;

fn weights(fixture: &Fixture) -> SkinWeights {
    SkinWeights::from_dense(&fixture.weights).expect("valid weights")
}

fn posed(method: &SkinningMethod, fixture: &Fixture, transforms: &[Transform]) -> Vec<[f32; 3]> {
    let packed = PackedWeights::new(&weights(fixture));
    let rest = to_f32(&fixture.skin);
    let mut out = vec![[f32::NAN; 3]; rest.len()];
    (method.pose)(&SkinningInput { transforms, weights: &packed, rest_skin: &rest }, &mut out);
    out
}

/// Ω as the oracle wants it: dense, every row 1 or 0.
fn normalised(fixture: &Fixture) -> Rows {
    let mut dense = fixture.weights.clone();
    for i in 0..dense.len() {
        let sum: f64 = dense.row(i).iter().sum();
        dense.row_mut(i).iter_mut().filter(|_| sum > 0.0).for_each(|w| *w /= sum);
    }
    dense
}

#[test]
fn identity_pose_leaves_the_rest_pose() {
    for method in METHODS {
        for fixture in fixtures::all() {
            let identity = vec![Transform::identity(); fixture.joints.len()];
            assert_eq!(posed(method, &fixture, &identity), to_f32(&fixture.skin), "{}", fixture.name);
        }
    }
}

#[test]
fn one_rigid_motion_for_all_bones_moves_weighted_vertices_rigidly() {
    for method in METHODS {
        for fixture in fixtures::all() {
            let motion = fixtures::turn(Point::new(0.3, 0.2, 0.1), Point::new(1.0, 2.0, 3.0), 2.0);
            let moved = fixtures::points(&posed(method, &fixture, &vec![motion; fixture.joints.len()]));
            let weights = weights(&fixture);
            for (i, v) in fixture.skin.iter().enumerate() {
                let wanted = if weights.row(i).is_empty() { *v } else { motion.apply(v) };
                assert!((moved[i] - wanted).norm() <= FRAME * fixture.size(), "{} {i}", fixture.name);
            }
        }
    }
}

#[test]
fn every_method_agrees_with_its_oracle_to_frame_precision() {
    for method in METHODS {
        let oracle =
            ORACLES.iter().find(|(name, _)| *name == method.name).expect("every method has an oracle").1;
        for fixture in fixtures::all() {
            let pose = fixtures::lively_pose(&fixture, 1.0);
            let expected = oracle(&pose, &normalised(&fixture), &fixture.skin);
            let frame = fixtures::points(&posed(method, &fixture, &pose));
            let error = fixtures::distance(&frame, &expected) / fixture.size();
            assert!(error <= FRAME, "{} {}: {error:e}", method.name, fixture.name);
        }
    }
}

#[test]
fn many_vertices_go_through_threads_to_the_same_result() {
    let fixture = fixtures::random::rig(fixtures::random::Recipe {
        skin_vertices: 20_000,
        joints: 7,
        cage_level: 0,
        seed: 9,
    });
    let pose = fixtures::lively_pose(&fixture, 1.0);
    for method in METHODS {
        let whole = posed(method, &fixture, &pose);
        let part = Fixture {
            skin: fixture.skin[15_000..].to_vec(),
            weights: fixture.weights.select(&(15_000..20_000).collect::<Vec<_>>()),
            ..fixture.clone()
        };
        assert_eq!(posed(method, &part, &pose), whole[15_000..]);
    }
}

#[test]
fn double_precision_blending_equals_the_oracle() {
    for fixture in fixtures::all() {
        let pose = fixtures::lively_pose(&fixture, 1.5);
        let expected = super::naive::lbs(&pose, &normalised(&fixture), &fixture.skin);
        let found = pose_points(&pose, &weights(&fixture), &fixture.skin);
        assert!(fixtures::distance(&found, &expected) <= 1e-13 * fixture.size(), "{}", fixture.name);
    }
}

#[test]
fn an_unknown_method_is_refused_with_the_known_ones() {
    let message = method("ragdoll").map(|_| ()).expect_err("there is none").to_string();
    assert!(message.contains("ragdoll") && message.contains("lbs"), "{message}");
}

#[test]
fn linear_blending_equals_the_reference_poses_of_the_arm() {
    if !arm::is_here() {
        return;
    }
    let fixture = arm::fixture();
    let mut poses = arm::open("poses");
    let (transforms, expected) = (poses.poses("T_skin"), poses.point_lists("Mp_lbs"));
    assert_eq!(transforms.len(), 8);
    for (pose, expected) in transforms.iter().zip(&expected) {
        let oracle = super::naive::lbs(pose, &normalised(&fixture), &fixture.skin);
        assert!(fixtures::distance(&oracle, expected) <= 1e-9);
        let frame = fixtures::points(&posed(&METHODS[0], &fixture, pose));
        assert!(fixtures::distance(&frame, expected) <= FRAME * fixture.size());
    }
}
