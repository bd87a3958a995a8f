//! What holds for any rig: forests in any order, empty weight rows, more cage than skin, scale.

mod common;

use cage_rig::skinning::METHODS;
use cage_rig::{bounding_diagonal, Point, Transform};
use common::random::{pose, rig, Recipe};
use common::{distance, nudged, points};
use proptest::prelude::*;

fn recipes() -> impl Strategy<Value = Recipe> {
    (1usize..120, 1usize..12, 0usize..2, any::<u64>()).prop_map(
        |(skin_vertices, joints, cage_level, seed)| Recipe { skin_vertices, joints, cage_level, seed },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn identity_leaves_everything_at_rest(recipe in recipes()) {
        let fixture = rig(recipe);
        let mut bound = fixture.rig();
        bound.pose(&vec![Transform::identity(); recipe.joints], None).expect("a valid pose");
        for method in METHODS {
            bound.set_method(method);
            prop_assert_eq!(bound.posed_skin().to_vec(), bound.rest_skin().to_vec());
        }
        prop_assert_eq!(bound.posed_cage(), fixture.cage);
    }

    #[test]
    fn coordinates_reproduce_skin_and_joints(recipe in recipes()) {
        let fixture = rig(recipe);
        let bound = fixture.rig();
        let size = bounding_diagonal(&fixture.cage);
        prop_assert!(bound.report().coordinate_error_max <= 1e-12 * size);
        prop_assert!(bound.report().joint_error_max <= 1e-10 * size);
        prop_assert!(bound.report().anchor_max_ratio <= 1.05);
    }

    #[test]
    fn every_number_stays_finite_and_unweighted_vertices_stay(recipe in recipes(), seed: u64) {
        let fixture = rig(recipe);
        let mut bound = fixture.rig();
        bound.pose(&pose(&fixture, 3.0, seed), None).expect("a valid pose");
        prop_assert!(bound.posed_cage().iter().all(|c| c.iter().all(|x| x.is_finite())));
        for method in METHODS {
            bound.set_method(method);
            prop_assert!(bound.posed_skin().iter().flatten().all(|x| x.is_finite()));
            for i in (0..fixture.skin.len()).filter(|&i| fixture.weights.row(i).iter().all(|w| *w == 0.0)) {
                let (rest, posed) = (bound.rest_skin()[i], bound.posed_skin()[i]);
                prop_assert_eq!(rest, posed);
            }
        }
    }

    #[test]
    fn the_loop_is_exact_or_refused_without_a_trace(recipe in recipes(), seed: u64) {
        let fixture = rig(recipe);
        let mut bound = fixture.rig();
        let transforms = pose(&fixture, 0.5, seed);
        bound.pose(&transforms, None).expect("a valid pose");
        let size = bounding_diagonal(&fixture.cage);
        let rest = bound.rest_cage().to_vec();
        let wanted = nudged(bound.posed_cage(), 0.02 * size, seed);
        match bound.edit_posed_cage(&wanted) {
            Ok(()) => {
                let mut fresh = fixture.rig();
                fresh.play(bound.rest_cage(), &transforms, None).expect("a valid frame");
                prop_assert!(distance(fresh.posed_cage(), &wanted) <= 1e-9 * size);
            }
            Err(error) => {
                prop_assert_eq!(bound.rest_cage(), rest);
                prop_assert!(false, "refused: {}", error);
            }
        }
    }

    #[test]
    fn vertices_of_one_bone_follow_it_whatever_the_method(recipe in recipes(), seed: u64) {
        let fixture = rig(recipe);
        let mut bound = fixture.rig();
        bound.play(&nudged(&fixture.cage, 0.05, seed), &pose(&fixture, 3.0, seed), None).expect("a valid frame");
        for method in METHODS {
            bound.set_method(method);
            let (posed, rest) = (points(bound.posed_skin()), points(bound.rest_skin()));
            for i in 0..rest.len() {
                let bones: Vec<usize> =
                    (0..recipe.joints).filter(|&j| fixture.weights.row(i)[j] > 0.0).collect();
                if let [bone] = bones[..] {
                    let wanted = bound.transforms()[bone].apply(&rest[i]);
                    prop_assert!((posed[i] - wanted).norm() <= 1e-5 * (1.0 + wanted.norm()), "{}", method.name);
                }
            }
        }
    }

    #[test]
    fn centers_stay_among_the_skin_and_their_rows_sum_to_one(recipe in recipes()) {
        let fixture = rig(recipe);
        let mut bound = fixture.rig();
        bound.set_method(cage_rig::skinning::method("cor").expect("it is there"));
        let coords = bound.center_coords().expect("the method needs them");
        let centers = coords.times(&fixture.cage);
        let bounds = |list: &[Point]| {
            list.iter().fold((list[0], list[0]), |(low, high), p| (low.inf(p), high.sup(p)))
        };
        let (low, high) = bounds(&fixture.skin);
        for (i, center) in centers.iter().enumerate() {
            prop_assert!((coords.row(i).iter().sum::<f64>() - 1.0).abs() < 1e-12);
            prop_assert!((0..3).all(|k| low[k] - 1e-9 <= center[k] && center[k] <= high[k] + 1e-9));
        }
    }

    #[test]
    fn a_frame_depends_on_its_own_cage_and_pose_alone(recipe in recipes(), seed: u64) {
        let fixture = rig(recipe);
        let cage = nudged(&fixture.cage, 0.1, seed);
        let transforms = pose(&fixture, 1.0, seed);
        let (mut wandering, mut direct) = (fixture.rig(), fixture.rig());
        wandering.pose(&pose(&fixture, 2.0, seed ^ 1), None).expect("a valid pose");
        wandering.edit_rest_cage(&nudged(&fixture.cage, 0.2, seed ^ 2)).expect("a valid cage");
        METHODS.iter().rev().for_each(|method| {
            wandering.set_method(method);
            wandering.posed_skin();
        });
        wandering.play(&cage, &transforms, None).expect("a valid frame");
        direct.edit_rest_cage(&cage).expect("a valid cage");
        direct.pose(&transforms, None).expect("a valid pose");
        prop_assert_eq!(wandering.posed_skin(), direct.posed_skin());
        prop_assert_eq!(wandering.posed_cage(), direct.posed_cage());
        prop_assert_eq!(points(wandering.rest_skin()), points(direct.rest_skin()));
    }
}
