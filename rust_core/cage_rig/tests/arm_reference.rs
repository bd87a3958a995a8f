//! The cycle against what the prototype of [CTL*20] computes for its own example.

mod common;

use cage_rig::{CoupledRig, Point};
use common::{arm, distance, points};

fn rig(prototype_joints: bool) -> CoupledRig {
    let mut input = arm::fixture().input();
    input.known.anchors = Some(arm::anchors());
    if prototype_joints {
        input.known.joint_coords = Some(arm::open("bind").rows("Psi"));
    }
    CoupledRig::new(input).expect("the arm binds")
}

#[test]
fn the_posed_cage_equals_the_reference() {
    if !arm::is_here() {
        return;
    }
    let (mut rig, mut poses) = (rig(false), arm::open("poses"));
    assert_eq!(rig.report().regularised, 0);
    let expected = poses.point_lists("Cp_lbs");
    for (pose, expected) in poses.poses("T_skin").iter().zip(&expected) {
        rig.pose(pose, None).expect("a valid pose");
        assert!(distance(rig.posed_cage(), expected) <= 1e-8);
    }
    assert_eq!(rig.work().anchor_factorisations, 1);
    assert_eq!(rig.work().reverse_factorisations, 0);
}

#[test]
fn the_arm_needs_no_attenuation_with_its_own_anchors_either() {
    if !arm::is_here() {
        return;
    }
    let rig = arm::fixture().rig();
    assert_eq!(rig.report().regularised, 0);
    assert!(rig.report().anchor_condition < 20.0);
    assert!(rig.report().anchor_max_ratio <= 1.05);
}

#[test]
fn a_drag_of_the_posed_cage_equals_the_reference() {
    if !arm::is_here() {
        return;
    }
    let mut sample = arm::open("reverse_sample");
    let mut rig = rig(true);
    let step = sample.points("dCp");
    let before = sample.point_lists("lbs_Cp_before");
    let [cages, skins, posed_skins, joints] =
        ["lbs_C_after", "lbs_M_after", "lbs_Mp_after", "lbs_rest_joints_after"]
            .map(|n| sample.point_lists(n));
    let poses = sample.poses("lbs_T_skin_after");
    let start = arm::fixture().cage;
    for k in 0..2 {
        // The prototype's transforms, read where it measured them.
        rig.play(&start, &poses[k], Some(&joints[k])).expect("a valid frame");
        assert!(distance(rig.posed_cage(), &before[k]) <= 1e-7);
        let wanted: Vec<Point> = before[k].iter().zip(&step).map(|(c, d)| c + d).collect();
        rig.edit_posed_cage(&wanted).expect("a solvable pose");
        assert!(distance(rig.rest_cage(), &cages[k]) <= 1e-7);
        assert!(distance(rig.joints(), &joints[k]) <= 1e-7);
        for (found, expected) in rig.transforms().iter().zip(&poses[k]) {
            assert!((found.translation - expected.translation).norm() <= 1e-7);
        }
        let frame = 2e-6 * rig.size();
        assert!(distance(&points(rig.rest_skin()), &skins[k]) <= frame);
        assert!(distance(&points(rig.posed_skin()), &posed_skins[k]) <= frame);
    }
}

#[test]
fn the_loop_returns_the_artists_cage_in_every_reference_pose() {
    if !arm::is_here() {
        return;
    }
    let fixture = arm::fixture();
    let step = arm::open("reverse_sample").points("dCp");
    for pose in arm::open("poses").poses("T_skin") {
        let mut rig = fixture.rig();
        rig.pose(&pose, None).expect("a valid pose");
        let wanted: Vec<Point> = rig.posed_cage().iter().zip(&step).map(|(c, d)| c + d).collect();
        rig.edit_posed_cage(&wanted).expect("a solvable pose");
        let mut fresh = fixture.rig();
        fresh.play(rig.rest_cage(), &pose, None).expect("a valid frame");
        assert!(distance(fresh.posed_cage(), &wanted) <= 1e-9 * fixture.size());
    }
}

#[test]
fn a_closed_path_in_every_reference_pose_ends_where_it_began() {
    if !arm::is_here() {
        return;
    }
    let fixture = arm::fixture();
    let step = arm::open("reverse_sample").points("dCp");
    let mut rig = fixture.rig();
    for pose in arm::open("poses").poses("T_skin") {
        rig.play(&fixture.cage, &pose, None).expect("a valid frame");
        let start = rig.posed_cage().to_vec();
        for k in 1..=20 {
            let share = (std::f64::consts::TAU * f64::from(k) / 20.0).sin();
            let share = if k == 20 { 0.0 } else { share };
            let cage: Vec<Point> = start.iter().zip(&step).map(|(c, d)| c + d * share).collect();
            rig.edit_posed_cage(&cage).expect("a solvable pose");
        }
        assert!(distance(rig.rest_cage(), &fixture.cage) <= 1e-9 * fixture.size());
    }
}
