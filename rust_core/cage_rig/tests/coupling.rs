//! The cycle as a whole: what an edit changes, what it leaves, what it costs.

mod common;

use cage_rig::skinning::METHODS;
use cage_rig::sync::BindInput;
use cage_rig::{CoupledRig, Point, PoseError, Transform};
use common::{all, arm, distance, forward, lively_pose, nudged, points, turn, Fixture};

fn cage_size(fixture: &Fixture) -> f64 {
    cage_rig::bounding_diagonal(&fixture.cage)
}

/// The posed cage as a rig that knows only C and T sees it.
fn posed_afresh(fixture: &Fixture, rig: &CoupledRig, pose: &[Transform]) -> Vec<Point> {
    let mut fresh = fixture.rig();
    fresh.play(rig.rest_cage(), pose, None).expect("a valid frame");
    fresh.posed_cage().to_vec()
}

#[test]
fn at_bind_everything_is_at_rest() {
    for fixture in all() {
        let mut rig = fixture.rig();
        let identity = vec![Transform::identity(); fixture.joints.len()];
        rig.pose(&identity, None).expect("a valid pose");
        assert!(distance(&points(rig.posed_skin()), &fixture.skin) <= 1e-7 * fixture.size());
        assert_eq!(rig.posed_skin().to_vec(), rig.rest_skin().to_vec());
        assert_eq!(rig.posed_cage(), fixture.cage);
        assert_eq!(rig.transforms(), identity);
        assert!(distance(rig.joints(), &fixture.joints) <= 1e-12 * cage_size(&fixture));
    }
}

#[test]
fn identity_transforms_keep_an_edited_cage_at_rest() {
    for fixture in all() {
        let mut rig = fixture.rig();
        let cage = nudged(&fixture.cage, 0.05 * cage_size(&fixture), 1);
        rig.edit_rest_cage(&cage).expect("a valid cage");
        assert_eq!(rig.posed_cage(), cage);
        assert_eq!(rig.posed_skin().to_vec(), rig.rest_skin().to_vec());
    }
}

#[test]
fn on_the_rest_cage_the_refit_transforms_are_those_of_the_animation() {
    for fixture in all() {
        let mut rig = fixture.rig();
        let pose = lively_pose(&fixture, 1.0);
        rig.pose(&pose, None).expect("a valid pose");
        for (found, given) in rig.transforms().iter().zip(&pose) {
            assert_eq!(found.linear, given.linear);
            assert!((found.translation - given.translation).norm() < 1e-11 * cage_size(&fixture));
        }
    }
}

#[test]
fn a_cage_moved_as_a_whole_carries_everything_and_the_pose() {
    // The whole rest cage moved by d: rest joints and skin move by d, bones keep their motion.
    for fixture in all() {
        let d = Point::new(0.3, -0.2, 0.5);
        let pose = lively_pose(&fixture, 0.8);
        let mut here = fixture.rig();
        here.pose(&pose, None).expect("a valid pose");
        let mut there = fixture.rig();
        let moved: Vec<Point> = fixture.cage.iter().map(|c| c + d).collect();
        there.play(&moved, &pose, None).expect("a valid frame");
        let expected: Vec<Point> = here.posed_joints().iter().map(|a| a + d).collect();
        assert!(distance(&there.posed_joints(), &expected) < 1e-10 * cage_size(&fixture), "{}", fixture.name);
    }
}

#[test]
fn transforms_measured_at_other_rest_joints_mean_the_same_motion() {
    let fixture = common::shapes::bar();
    let cage = nudged(&fixture.cage, 0.2, 3);
    let pose = lively_pose(&fixture, 1.0);
    let mut rig = fixture.rig();
    rig.play(&cage, &pose, None).expect("a valid frame");
    let (refit, joints) = (rig.transforms().to_vec(), rig.joints().to_vec());
    // An armature whose rest bones were moved to the refit joints animates by the refit transforms.
    let mut applied = fixture.rig();
    applied.play(&cage, &refit, Some(&joints)).expect("a valid frame");
    for (a, b) in applied.transforms().iter().zip(&refit) {
        assert!((a.translation - b.translation).norm() < 1e-12 * cage_size(&fixture));
    }
}

#[test]
fn the_artists_posed_cage_is_kept_through_the_whole_loop() {
    for fixture in all() {
        let mut rig = fixture.rig();
        let pose = lively_pose(&fixture, 0.6);
        rig.pose(&pose, None).expect("a valid pose");
        let wanted = nudged(rig.posed_cage(), 0.03 * fixture.size(), 2);
        rig.edit_posed_cage(&wanted).expect("a solvable pose");
        assert!(distance(rig.posed_cage(), &wanted) <= 1e-9 * fixture.size());
        let again = posed_afresh(&fixture, &rig, &pose);
        assert!(distance(&again, &wanted) <= 1e-9 * fixture.size(), "{}", fixture.name);
    }
}

#[test]
fn whatever_the_method_the_posed_cage_lands_where_it_is_dragged() {
    // An elbow at a right angle. The visible skin differs, cages and joints do not.
    for fixture in all() {
        let mut pose = vec![Transform::identity(); fixture.joints.len()];
        pose[1] = common::turn(fixture.joints[1], Point::y(), std::f64::consts::FRAC_PI_2);
        let mut linear = fixture.rig();
        linear.pose(&pose, None).expect("a valid pose");
        let wanted = nudged(linear.posed_cage(), 0.03 * fixture.size(), 6);
        linear.edit_posed_cage(&wanted).expect("a solvable pose");
        for method in METHODS {
            let mut rig = CoupledRig::new(BindInput { method, ..fixture.input() }).expect("it binds");
            rig.pose(&pose, None).expect("a valid pose");
            rig.edit_posed_cage(&wanted).expect("a solvable pose");
            assert_eq!(rig.rest_cage(), linear.rest_cage(), "{}", method.name);
            let mut fresh = CoupledRig::new(BindInput { method, ..fixture.input() }).expect("it binds");
            fresh.play(rig.rest_cage(), &pose, None).expect("a valid frame");
            assert!(distance(fresh.posed_cage(), &wanted) <= 1e-9 * fixture.size(), "{}", method.name);
            let apart = distance(&points(rig.posed_skin()), &points(linear.posed_skin()));
            assert_eq!(apart == 0.0, method.name == "lbs", "{} {}", method.name, fixture.name);
        }
    }
}

#[test]
fn a_method_changes_the_posed_skin_alone_and_at_any_time() {
    for fixture in all() {
        for method in METHODS {
            let pose = lively_pose(&fixture, 0.6);
            let cage = nudged(&fixture.cage, 0.05 * cage_size(&fixture), 8);
            let mut bound = CoupledRig::new(BindInput { method, ..fixture.input() }).expect("it binds");
            let mut changed = fixture.rig();
            for rig in [&mut bound, &mut changed] {
                rig.play(&cage, &pose, None).expect("a valid frame");
                rig.posed_skin();
                rig.posed_cage();
            }
            let before = changed.work();
            changed.set_method(method);
            assert_eq!(changed.method().number, method.number);
            assert_eq!(changed.posed_skin(), bound.posed_skin());
            assert_eq!(changed.posed_cage(), bound.posed_cage());
            let after = changed.work();
            let skinned = usize::from(method.name != "lbs");
            assert_eq!(after.skin_passes, before.skin_passes + skinned);
            assert_eq!((after.cage_fits, after.rest_passes), (before.cage_fits, before.rest_passes));
            let centers = usize::from(method.centers);
            assert_eq!((after.center_integrations, after.center_passes), (centers, centers));
            changed.set_method(method);
            changed.posed_skin();
            assert_eq!(changed.work(), after, "the same method again is no work");
        }
    }
}

#[test]
fn centers_are_integrated_once_and_moved_when_the_cage_is() {
    let fixture = common::shapes::bar();
    let [lbs, cor] = ["lbs", "cor"].map(|name| cage_rig::skinning::method(name).expect("it is there"));
    let mut rig = fixture.rig();
    assert_eq!((rig.work().center_integrations, rig.center_coords()), (0, None));
    let mut counts = Vec::new();
    let cages = [1, 1, 2, 2].map(|seed| nudged(&fixture.cage, 0.1, seed));
    for (method, (cage, amount)) in [cor, cor, lbs, cor].iter().zip(cages.iter().zip([0.1, 0.2, 0.3, 0.4])) {
        rig.set_method(method);
        rig.play(cage, &lively_pose(&fixture, amount), None).expect("a valid frame");
        rig.posed_skin();
        counts.push((rig.work().center_integrations, rig.work().center_passes));
    }
    assert_eq!(counts, [(1, 1), (1, 1), (1, 1), (1, 2)]);
    // Given ones are taken as they are.
    let coords = rig.center_coords().cloned();
    let mut input = fixture.input();
    (input.method, input.known.center_coords) = (cor, coords.clone());
    let mut again = CoupledRig::new(input).expect("it binds");
    again.play(&cages[3], &lively_pose(&fixture, 0.4), None).expect("a valid frame");
    assert_eq!(again.posed_skin(), rig.posed_skin());
    assert_eq!((again.center_coords().cloned(), again.work().center_integrations), (coords, 0));
}

#[test]
fn a_closed_drag_has_no_hysteresis() {
    for fixture in all() {
        let mut rig = fixture.rig();
        rig.pose(&lively_pose(&fixture, 0.6), None).expect("a valid pose");
        let (start, rest) = (rig.posed_cage().to_vec(), rig.rest_cage().to_vec());
        for step in 1..=20 {
            let angle = std::f64::consts::TAU * f64::from(step) / 20.0;
            let offset =
                Point::new(angle.cos() - 1.0, angle.sin(), 0.3 * angle.sin()) * 0.05 * fixture.size();
            let mut cage = start.clone();
            cage.iter_mut().step_by(5).for_each(|c| *c += offset);
            rig.edit_posed_cage(&cage).expect("a solvable pose");
        }
        assert!(distance(rig.rest_cage(), &rest) <= 1e-9 * fixture.size(), "{}", fixture.name);
    }
}

#[test]
fn work_is_done_once_and_only_when_it_is_due() {
    for fixture in all() {
        let mut rig = fixture.rig();
        let read = |rig: &mut CoupledRig| {
            rig.posed_skin();
            rig.posed_cage();
            rig.work()
        };
        let start = read(&mut rig);
        assert_eq!(start, cage_rig::sync::Work { anchor_factorisations: 1, ..Default::default() });

        let pose = lively_pose(&fixture, 0.6);
        rig.pose(&pose, None).expect("a valid pose");
        let posed = read(&mut rig);
        assert_eq!((posed.rest_passes, posed.skin_passes, posed.cage_fits), (0, 1, 1));
        assert_eq!((posed.anchor_factorisations, posed.reverse_factorisations), (1, 0));

        for step in 1..=5 {
            let cage = nudged(rig.posed_cage(), 0.001 * fixture.size(), step);
            rig.edit_posed_cage(&cage).expect("a solvable pose");
        }
        let dragged = read(&mut rig);
        assert_eq!((dragged.anchor_factorisations, dragged.reverse_factorisations), (1, 1), "one per pose");

        // The same again is no work at all.
        let (cage, posed_cage) = (rig.rest_cage().to_vec(), rig.posed_cage().to_vec());
        rig.pose(&pose, None).expect("a valid pose");
        rig.edit_rest_cage(&cage).expect("a valid cage");
        rig.edit_posed_cage(&posed_cage).expect("a valid cage");
        rig.play(&cage, &pose, None).expect("a valid frame");
        rig.offset_rest_skin(None).expect("no offsets");
        assert_eq!(read(&mut rig), dragged);

        // Bones that move without turning keep the factors.
        let moved: Vec<Transform> =
            pose.iter().map(|t| Transform { translation: t.translation + Point::x(), ..*t }).collect();
        rig.pose(&moved, None).expect("a valid pose");
        rig.edit_posed_cage(&nudged(&posed_cage, 0.001, 9)).expect("a solvable pose");
        assert_eq!(rig.work().reverse_factorisations, 1);
        rig.pose(&lively_pose(&fixture, 0.5), None).expect("a valid pose");
        assert_eq!(rig.work().reverse_factorisations, 1, "posing factors nothing");
        rig.edit_posed_cage(&posed_cage).expect("a solvable pose");
        assert_eq!(rig.work().reverse_factorisations, 2);
    }
}

#[test]
fn a_drag_costs_by_the_joints_that_are_bent() {
    let mut low_rank = 0;
    for fixture in all() {
        let mut rig = fixture.rig();
        let last = fixture.joints.len() - 1;
        let mut local = vec![Transform::identity(); fixture.joints.len()];
        local[last] = turn(fixture.joints[last], Point::new(0.3, 0.2, 1.0), 0.5);
        rig.pose(&forward(&fixture, &local), None).expect("a valid pose");
        for step in 1..=3 {
            let wanted = nudged(rig.posed_cage(), 0.01 * fixture.size(), step);
            rig.edit_posed_cage(&wanted).expect("a solvable pose");
            let (cage, transforms) = (rig.rest_cage().to_vec(), forward(&fixture, &local));
            let mut again = fixture.rig();
            again.play(&cage, &transforms, None).expect("a valid frame");
            assert!(distance(again.posed_cage(), &wanted) < 1e-9 * fixture.size(), "{}", fixture.name);
        }
        let work = rig.work();
        assert!(work.reverse_factorisations <= 1 + work.reverse_low_rank);
        low_rank += work.reverse_low_rank;
        // All joints bent: dense.
        let before = work.reverse_low_rank;
        rig.pose(&lively_pose(&fixture, 0.5), None).expect("a valid pose");
        let wanted = nudged(rig.posed_cage(), 0.001, 9);
        rig.edit_posed_cage(&wanted).expect("a solvable pose");
        if 3 * fixture.joints.len() > fixture.cage.len() {
            assert_eq!(rig.work().reverse_low_rank, before);
        }
    }
    assert!(low_rank > 0);
}

#[test]
fn offsets_move_the_skin_and_nothing_else() {
    let fixture = common::shapes::blob();
    let pose = lively_pose(&fixture, 0.5);
    let (mut plain, mut offset) = (fixture.rig(), fixture.rig());
    let shape: Vec<Point> = fixture.skin.iter().map(|p| p * 0.1).collect();
    offset.offset_rest_skin(Some(&shape)).expect("one per vertex");
    plain.pose(&pose, None).expect("a valid pose");
    offset.pose(&pose, None).expect("a valid pose");
    assert_eq!(plain.posed_cage(), offset.posed_cage());
    assert_eq!(plain.joints(), offset.joints());
    let expected: Vec<Point> = fixture.skin.iter().map(|p| p * 1.1).collect();
    assert!(distance(&points(offset.rest_skin()), &expected) < 1e-6);
    assert!(distance(&points(offset.posed_skin()), &points(plain.posed_skin())) > 0.05);
    offset.offset_rest_skin(None).expect("back again");
    assert_eq!(plain.posed_skin(), offset.posed_skin());
}

#[test]
fn a_refused_edit_leaves_the_rig_as_it_was() {
    let fixture = common::shapes::bar();
    let mut rig = fixture.rig();
    rig.pose(&lively_pose(&fixture, 0.5), None).expect("a valid pose");
    let before = (rig.rest_cage().to_vec(), rig.transforms().to_vec(), rig.posed_skin().to_vec());
    let mut bad_cage = fixture.cage.clone();
    bad_cage[3].y = f64::INFINITY;
    let mut bad_pose = lively_pose(&fixture, 0.7);
    bad_pose[1].translation.x = f64::NAN;
    assert_eq!(rig.edit_rest_cage(&bad_cage), Err(PoseError::CageNotFinite { vertex: 3 }));
    assert_eq!(rig.edit_posed_cage(&bad_cage), Err(PoseError::CageNotFinite { vertex: 3 }));
    assert_eq!(rig.pose(&bad_pose, None), Err(PoseError::TransformNotFinite { joint: 1 }));
    let expected = fixture.cage.len();
    assert_eq!(
        rig.edit_rest_cage(&bad_cage[1..]),
        Err(PoseError::CageCount { expected, found: expected - 1 })
    );
    assert_eq!(rig.pose(&[], None), Err(PoseError::TransformCount { expected: 3, found: 0 }));
    let pose = lively_pose(&fixture, 0.7);
    assert_eq!(rig.pose(&pose, Some(&[])), Err(PoseError::JointCount { expected: 3, found: 0 }));
    assert!(rig.play(&fixture.cage, &bad_pose, None).is_err());
    assert!(rig.offset_rest_skin(Some(&[])).is_err());
    assert_eq!((rig.rest_cage().to_vec(), rig.transforms().to_vec(), rig.posed_skin().to_vec()), before);
}

#[test]
fn a_bone_squashed_flat_refuses_posed_edits_and_nothing_else() {
    let fixture = common::shapes::bar();
    let mut rig = fixture.rig();
    let mut flat = vec![Transform::identity(); 3];
    flat.iter_mut().for_each(|t| t.linear[(1, 1)] = 0.0);
    rig.pose(&flat, None).expect("a flat pose can be shown");
    let rest = rig.rest_cage().to_vec();
    let wanted = nudged(rig.posed_cage(), 0.1, 4);
    assert!(matches!(
        rig.edit_posed_cage(&wanted),
        Err(PoseError::Singular { .. } | PoseError::Unreachable { .. })
    ));
    assert_eq!(rig.rest_cage(), rest);
    rig.pose(&lively_pose(&fixture, 0.2), None).expect("a valid pose");
    rig.edit_posed_cage(&wanted).expect("solvable again");
}

#[test]
fn the_report_names_what_was_done() {
    let blob = common::shapes::blob().rig();
    assert_eq!(blob.report().unweighted_joints, [4]);
    assert!(blob.report().unweighted_vertices > 0);
    let mut outside = common::shapes::bar();
    outside.joints[0] = Point::new(-2.0, 0.0, -3.0);
    let rig = outside.rig();
    assert_eq!(rig.report().joints_outside_hull, [0]);
    assert!(rig.report().joint_error_max <= 1e-10 * outside.size(), "both constraints hold outside too");
    let sum: f64 = rig.joint_coords().row(0).iter().sum();
    assert!((sum - 1.0).abs() < 1e-12);
    let mut inside_out = common::shapes::bar();
    inside_out.cage_faces.corners.reverse();
    inside_out.cage_faces.sizes.reverse();
    assert!(inside_out.rig().report().cage_turned && !rig.report().cage_turned);
}

#[test]
fn joints_are_reproduced_by_their_coordinates() {
    let mut fixtures = all();
    if arm::is_here() {
        fixtures.push(arm::fixture());
    }
    for fixture in fixtures {
        let rig = fixture.rig();
        assert_eq!(rig.report().joints_outside_hull, [0usize; 0], "{}", fixture.name);
        let found = rig.joint_coords().times(&fixture.cage);
        assert!(distance(&found, &fixture.joints) <= 1e-10 * fixture.size(), "{}", fixture.name);
    }
}
