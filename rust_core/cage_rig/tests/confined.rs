//! Cages that act on a part of the character: partial cages, masks, and cages above one another.

mod common;

use cage_rig::coordinates::mean_value;
use cage_rig::skinning::METHODS;
use cage_rig::sync::{BindInput, Carried};
use cage_rig::{unwatched, CoupledRig, Error, Point, SkinError};
use common::shapes::{bar, partly_caged};
use common::{distance, lively_pose, nudged, points, Fixture};

fn displaced(now: &[Point], before: &[Point]) -> Vec<Point> {
    now.iter().zip(before).map(|(n, b)| n - b).collect()
}

fn ramp(fixture: &Fixture) -> Vec<f32> {
    fixture.skin.iter().map(|p| ((p.x - 3.0) / 4.0).clamp(0.0, 1.0) as f32).collect()
}

#[test]
fn a_partial_cage_moves_what_it_encloses_and_nothing_far_away() {
    let fixture = partly_caged();
    let mut rig = fixture.rig();
    let report = rig.report().clone();
    assert!(report.vertices_outside > 100 && report.vertices_out_of_reach > 50, "{report:?}");
    let cage: Vec<Point> = fixture.cage.iter().map(|c| Point::new(c.x, 1.5 * c.y, 1.5 * c.z)).collect();
    rig.edit_rest_cage(&cage).expect("a valid cage");
    let moved = displaced(&points(rig.rest_skin()), &fixture.skin);
    for (step, place) in moved.iter().zip(&fixture.skin) {
        // Enclosed from 5.6 on; the mean edge of the cage is below 2.
        if place.x > 5.7 {
            let wanted = Point::new(0.0, 0.5 * place.y, 0.5 * place.z);
            assert!((step - wanted).norm() < 1e-5, "{place} {step}");
        } else if place.x < 3.6 {
            assert!(step.norm() < 1e-6, "{place}"); // single precision
        }
    }
    // Between, the movement falls off without a step: neighbours are a sixth apart.
    let along: Vec<f64> = (0..=60).map(|i| moved[4 * i].norm()).collect();
    assert!(along.windows(2).all(|w| (w[0] - w[1]).abs() < 0.15), "{along:?}");
    let shifted: Vec<Point> = fixture.cage.iter().map(|c| c + Point::new(1.0, 0.0, 0.0)).collect();
    rig.edit_rest_cage(&shifted).expect("a valid cage");
    let steps: Vec<f64> =
        rig.joints().iter().zip(&fixture.joints).map(|(now, bound)| (now - bound).norm()).collect();
    assert!(steps[0] < 1e-12 && steps[1] < 0.1 && (steps[2] - 1.0).abs() < 1e-9, "{steps:?}");
}

#[test]
fn the_posed_cage_of_a_partial_cage_stays_at_its_part_and_lands_where_it_is_dragged() {
    let fixture = partly_caged();
    let mut rig = fixture.rig();
    rig.pose(&lively_pose(&fixture, 0.8), None).expect("a valid pose");
    let anchors = rig.anchors().to_vec();
    assert!(anchors.iter().all(|&i| fixture.skin[i].x >= 5.6), "anchors are enclosed");
    let posed = rig.posed_cage().to_vec();
    let skin = points(rig.posed_skin());
    let part: Vec<&Point> =
        skin.iter().zip(&fixture.skin).filter(|(_, v)| v.x > 5.6).map(|(p, _)| p).collect();
    for c in &posed {
        let nearest = part.iter().map(|p| (*p - c).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1.0, "{nearest}");
    }
    let wanted = nudged(&posed, 0.3, 2);
    rig.edit_posed_cage(&wanted).expect("it can be reached");
    let mut fresh = fixture.rig();
    fresh.play(rig.rest_cage(), &lively_pose(&fixture, 0.8), None).expect("a valid frame");
    assert!(distance(fresh.posed_cage(), &wanted) < 1e-9);
}

#[test]
fn a_cage_beside_the_skin_is_refused() {
    let mut fixture = bar();
    fixture.cage.iter_mut().for_each(|c| c.y += 100.0);
    let refused = CoupledRig::new(fixture.input()).map(|_| ());
    assert_eq!(refused, Err(Error::Skin(SkinError::OutOfReach)));
}

#[test]
fn a_mask_confines_skin_and_joints_and_comes_off_without_a_trace() {
    let fixture = bar();
    let cage: Vec<Point> = fixture.cage.iter().map(|c| Point::new(1.2 * c.x, 1.5 * c.y, c.z)).collect();
    for method in METHODS {
        let mut rig = CoupledRig::new(BindInput { method, ..fixture.input() }).expect("it binds");
        rig.play(&cage, &lively_pose(&fixture, 0.7), None).expect("a valid frame");
        let whole = (points(rig.rest_skin()), points(rig.posed_skin()), rig.joints().to_vec());
        let mask = ramp(&fixture);
        rig.mask_skin(Some(&mask)).expect("a valid mask");
        let masked = points(rig.rest_skin());
        for i in 0..masked.len() {
            let wanted = fixture.skin[i] + (whole.0[i] - fixture.skin[i]) * f64::from(mask[i]);
            assert!((masked[i] - wanted).norm() < 2e-6);
        }
        assert!((rig.joints()[0] - fixture.joints[0]).norm() < 1e-12, "the skin around it is masked out");
        let (free, bound) = (whole.2[2] - fixture.joints[2], rig.joints()[2] - fixture.joints[2]);
        assert!(bound.norm() > 0.7 * free.norm() && bound.norm() < free.norm());
        rig.mask_skin(Some(&vec![0.0; mask.len()])).expect("a valid mask");
        let mut still = CoupledRig::new(BindInput { method, ..fixture.input() }).expect("it binds");
        still.pose(&lively_pose(&fixture, 0.7), None).expect("a valid pose");
        assert!(distance(&points(rig.posed_skin()), &points(still.posed_skin())) < 1e-5, "{}", method.name);
        rig.mask_skin(None).expect("no mask");
        assert_eq!((points(rig.rest_skin()), points(rig.posed_skin()), rig.joints().to_vec()), whole);
    }
}

#[test]
fn influence_is_what_the_skin_moves_by_in_the_rest_pose() {
    for (fixture, masked) in [(bar(), false), (bar(), true), (partly_caged(), false), (partly_caged(), true)]
    {
        let mut rig = fixture.rig();
        if masked {
            rig.mask_skin(Some(&ramp(&fixture))).expect("a valid mask");
        }
        let chosen: Vec<usize> = (0..fixture.cage.len()).step_by(3).collect();
        let influence =
            rig.cage_influence(&chosen.iter().map(|&v| v as i64).collect::<Vec<_>>()).expect("cage vertices");
        let mut cage = fixture.cage.clone();
        chosen.iter().for_each(|&v| cage[v].y += 0.25);
        rig.edit_rest_cage(&cage).expect("a valid cage");
        let moved = displaced(&points(rig.rest_skin()), &fixture.skin);
        assert!(influence.iter().any(|part| *part > 0.1));
        for (step, part) in moved.iter().zip(&influence) {
            assert!((step.y - 0.25 * f64::from(*part)).abs() < 2e-6, "{step} {part}");
        }
    }
    let fault = bar().rig().cage_influence(&[0, 99]).expect_err("the cage has fewer vertices");
    assert!(fault.to_string().starts_with("there is no cage vertex 99; the cage has "), "{fault}");
}

#[test]
fn with_a_mask_the_posed_cage_still_lands_where_it_is_dragged() {
    let fixture = bar();
    let pose = lively_pose(&fixture, 0.9);
    let mask = ramp(&fixture);
    let mut rig = fixture.rig();
    rig.pose(&pose, None).expect("a valid pose");
    let step = nudged(rig.posed_cage(), 0.2, 3);
    rig.edit_posed_cage(&step).expect("it can be reached");
    rig.mask_skin(Some(&mask)).expect("a valid mask");
    let wanted = nudged(rig.posed_cage(), 0.2, 4);
    rig.edit_posed_cage(&wanted).expect("it can be reached");
    let mut fresh = fixture.rig();
    fresh.mask_skin(Some(&mask)).expect("a valid mask");
    fresh.play(rig.rest_cage(), &pose, None).expect("a valid frame");
    assert!(distance(fresh.posed_cage(), &wanted) < 1e-9);
}

#[test]
fn bad_masks_are_refused_by_row_and_change_nothing() {
    let fixture = bar();
    let mut rig = fixture.rig();
    rig.edit_rest_cage(&nudged(&fixture.cage, 0.2, 1)).expect("a valid cage");
    let before = rig.rest_skin().to_vec();
    let mut mask = ramp(&fixture);
    mask[7] = f32::NAN;
    assert!(matches!(rig.mask_skin(Some(&mask)), Err(SkinError::MaskRange { row: 7, .. })));
    mask[7] = 1.01;
    assert!(matches!(rig.mask_skin(Some(&mask)), Err(SkinError::MaskRange { row: 7, .. })));
    let count = mask.len();
    assert_eq!(
        rig.mask_skin(Some(&mask[1..])),
        Err(SkinError::MaskCount { expected: count, found: count - 1 })
    );
    assert_eq!(rig.rest_skin().to_vec(), before);
}

/// A fine cage that stands on a coarse one, as an add-on wires them.
fn stand_on(
    fine: &mut CoupledRig,
    coarse: &mut CoupledRig,
    fine_coords: &cage_rig::Rows,
    at_bind: (&Fixture, &Fixture),
) {
    let (lower, upper) = at_bind;
    let moved = displaced(coarse.rest_cage(), &lower.cage);
    let carried =
        Carried { cage: fine_coords.times(&moved), joints: displaced(coarse.joints(), &lower.joints) };
    fine.carry(Some(carried)).expect("the same joints");
    let offsets = displaced(&points(coarse.rest_skin()), &upper.skin);
    fine.offset_rest_skin(Some(&offsets)).expect("the same skin");
}

#[test]
fn a_fine_cage_adds_to_what_a_coarse_cage_does() {
    let (lower, upper) = (bar(), partly_caged());
    let coords = unwatched(|part| mean_value::coordinates(&lower.cage(), &upper.cage, part));
    let pose = lively_pose(&lower, 0.7);
    let (mut coarse, mut fine) = (lower.rig(), upper.rig());
    let long: Vec<Point> = lower.cage.iter().map(|c| Point::new(1.3 * c.x, c.y, c.z)).collect();
    coarse.play(&long, &pose, None).expect("a valid frame");
    fine.pose(&pose, None).expect("a valid pose");
    stand_on(&mut fine, &mut coarse, &coords, (&lower, &upper));
    // A fine cage at rest changes nothing of what the coarse one does.
    assert!(distance(&points(fine.posed_skin()), &points(coarse.posed_skin())) < 1e-5);
    assert!(distance(fine.joints(), coarse.joints()) < 1e-11);
    // It is carried along: all of it is near the stretched end.
    let skin = points(fine.posed_skin());
    for c in fine.posed_cage() {
        assert!(skin.iter().any(|p| (p - c).norm() < 1.0));
    }
    // Fattened, it adds its own part, and is dragged exactly.
    let fat: Vec<Point> = upper.cage.iter().map(|c| Point::new(c.x, 1.5 * c.y, 1.5 * c.z)).collect();
    fine.edit_rest_cage(&fat).expect("a valid cage");
    let rest = points(fine.rest_skin());
    let end = rest.len() - 1;
    let expected = Point::new(1.3 * upper.skin[end].x, 1.5 * upper.skin[end].y, 1.5 * upper.skin[end].z);
    assert!((rest[end] - expected).norm() < 1e-5, "{} {expected}", rest[end]);
    let wanted = nudged(fine.posed_cage(), 0.2, 8);
    fine.edit_posed_cage(&wanted).expect("it can be reached");
    let mut fresh = upper.rig();
    stand_on(&mut fresh, &mut coarse, &coords, (&lower, &upper));
    fresh.play(fine.rest_cage(), &pose, None).expect("a valid frame");
    assert!(distance(fresh.posed_cage(), &wanted) < 1e-9);
    fine.carry(None).expect("nothing below");
    fine.edit_rest_cage(&upper.cage).expect("a valid cage");
    assert!(distance(fine.joints(), &upper.joints) < 1e-11);
}

#[test]
fn bad_carried_movements_are_refused() {
    let fixture = bar();
    let mut rig = fixture.rig();
    let (cage, joints) =
        (vec![Point::zeros(); fixture.cage.len()], vec![Point::zeros(); fixture.joints.len()]);
    assert!(rig.carry(Some(Carried { cage: cage[1..].to_vec(), joints: joints.clone() })).is_err());
    assert!(rig.carry(Some(Carried { cage: cage.clone(), joints: joints[1..].to_vec() })).is_err());
    let broken = vec![Point::new(f64::NAN, 0.0, 0.0); fixture.joints.len()];
    assert!(rig.carry(Some(Carried { cage, joints: broken })).is_err());
}

#[test]
fn centers_of_rotation_of_a_partly_caged_skin_stay_in_it_and_move_with_it() {
    let fixture = partly_caged();
    let method = cage_rig::skinning::method("cor").expect("it is there");
    let mut rig = CoupledRig::new(BindInput { method, ..fixture.input() }).expect("it binds");
    let fat: Vec<Point> = fixture.cage.iter().map(|c| Point::new(c.x, 1.5 * c.y, 1.5 * c.z)).collect();
    rig.play(&fat, &lively_pose(&fixture, 0.7), None).expect("a valid frame");
    let mut wholly = CoupledRig::new(BindInput { method, ..bar().input() }).expect("it binds");
    wholly.pose(&lively_pose(&fixture, 0.7), None).expect("a valid pose");
    let (part, whole) = (points(rig.posed_skin()), points(wholly.posed_skin()));
    for (i, place) in fixture.skin.iter().enumerate().filter(|(_, v)| v.x < 2.0) {
        assert!((part[i] - whole[i]).norm() < 1e-2, "{place}: {} {}", part[i], whole[i]);
    }
}
