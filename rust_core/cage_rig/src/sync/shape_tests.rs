//! Cages that go through few shapes, and such as only seem to.

use super::frame_tests::{assert_near, character, exact, FRAME};
use super::Work;
use crate::fixtures::{self, random::Random, Fixture};
use crate::panels::Precision;
use crate::points::Point;
use crate::skinning::METHODS;
use crate::sync::CoupledRig;

/// `keys` cages apart from the bind's, and the bind's itself.
fn keyed(fixture: &Fixture, keys: u64) -> Vec<Vec<Point>> {
    (0..keys).map(|seed| fixtures::nudged(&fixture.cage, if seed == 0 { 0.0 } else { 0.2 }, seed)).collect()
}

/// Between two cages as Blender gives it: in single precision.
fn between(one: &[Point], other: &[Point], part: f64) -> Vec<Point> {
    let single = |x: f64| f64::from(x as f32);
    one.iter().zip(other).map(|(a, b)| (a + (b - a) * part).map(single)).collect()
}

/// Plays from key to key in so many frames, comparing every frame.
fn play(fixture: &Fixture, rig: &mut CoupledRig, keys: &[Vec<Point>], frames: usize) {
    for pair in keys.windows(2) {
        for frame in 0..frames {
            let cage = between(&pair[0], &pair[1], frame as f64 / frames as f64);
            rig.edit_rest_cage(&cage).expect("a valid cage");
            assert_near(fixture, rig, None, None);
        }
    }
}

#[test]
fn a_cage_between_two_keys_is_read_as_shapes() {
    let fixture = character();
    for first in 0..2 {
        let (mut rig, keys) = (fixture.rig(), keyed(&fixture, 3));
        play(&fixture, &mut rig, &keys[first..first + 2], 48);
        let Work { rest_passes, rest_shape_passes, .. } = rig.work();
        assert!(rest_passes - rest_shape_passes <= 8, "{:?}", rig.work());
        play(&fixture, &mut rig, &keys[first..first + 2], 31);
        let again = rig.work();
        assert_eq!(again.rest_shape_passes - rest_shape_passes, again.rest_passes - rest_passes);
    }
}

#[test]
fn a_cage_from_key_to_key_takes_the_next_one_up() {
    let fixture = character();
    let (mut rig, keys) = (fixture.rig(), keyed(&fixture, 8));
    for _ in 0..3 {
        play(&fixture, &mut rig, &keys, 24);
    }
    let Work { rest_passes, rest_shape_passes, .. } = rig.work();
    assert!(rest_shape_passes * 10 >= rest_passes * 7, "{:?}", rig.work());
}

#[test]
fn three_keys_at_once_are_shapes_too() {
    let fixture = character();
    let (mut rig, mut random, keys) = (fixture.rig(), Random::new(5), keyed(&fixture, 4));
    for frame in 0..40 {
        let parts = [(); 3].map(|()| random.unit());
        let cage = (0..fixture.cage.len()).map(|k| {
            let by = |s: usize| (keys[s + 1][k] - fixture.cage[k]) * parts[s];
            fixture.cage[k] + by(0) + by(1) + by(2)
        });
        rig.edit_rest_cage(&cage.collect::<Vec<_>>()).expect("a valid cage");
        assert_near(&fixture, &mut rig, None, None);
        assert_eq!(rig.work().rest_shape_passes, (frame as usize + 1).saturating_sub(3));
    }
}

#[test]
fn a_cage_that_moves_freely_is_no_shape() {
    let fixture = character();
    let mut rig = fixture.rig();
    for frame in 0..60 {
        rig.edit_rest_cage(&fixtures::nudged(&fixture.cage, 0.2, frame)).expect("a valid cage");
        assert_near(&fixture, &mut rig, None, None);
    }
    assert_eq!(rig.work().rest_shape_passes, 0);
}

#[test]
fn what_no_shape_has_is_seen() {
    let fixture = character();
    let (mut rig, keys) = (fixture.rig(), keyed(&fixture, 2));
    play(&fixture, &mut rig, &keys, 10);
    let before = rig.work();
    // Some vertices, too many for a drag, that are off the line by a thousandth of a thousandth of the size.
    let mut cage = between(&keys[0], &keys[1], 0.5);
    cage.iter_mut().step_by(2).for_each(|c| c.y += 1e-6 * fixture.size());
    rig.edit_rest_cage(&cage).expect("a valid cage");
    let expected = exact(&fixture, &rig, None, None);
    let apart = fixtures::distance(&fixtures::points(rig.rest_skin()), &expected);
    assert!(apart <= 0.5 * FRAME * fixture.size(), "{apart:e}");
    let after = rig.work();
    assert_eq!(
        (after.rest_passes, after.rest_shape_passes),
        (before.rest_passes + 1, before.rest_shape_passes)
    );
}

#[test]
fn masks_and_offsets_apply_to_shapes() {
    let fixture = character();
    let (mut rig, mut random, keys) = (fixture.rig(), Random::new(6), keyed(&fixture, 2));
    for frame in 0..30 {
        let mask: Option<Vec<f32>> =
            (frame / 5 % 2 > 0).then(|| fixture.skin.iter().map(|i| (i.x.abs() as f32).min(1.0)).collect());
        rig.mask_skin(mask.as_deref()).expect("a valid mask");
        let offsets: Option<Vec<Point>> =
            (frame % 3 > 0).then(|| fixture.skin.iter().map(|_| random.point() * 0.1).collect());
        rig.offset_rest_skin(offsets.as_deref()).expect("valid offsets");
        rig.edit_rest_cage(&between(&keys[0], &keys[1], f64::from(frame) / 30.0)).expect("a valid cage");
        assert_near(&fixture, &mut rig, mask.as_deref(), offsets.as_deref());
    }
    assert!(rig.work().rest_shape_passes >= 15, "{:?}", rig.work());
}

#[test]
fn a_drag_begins_at_a_shape() {
    let fixture = character();
    let (mut rig, keys) = (fixture.rig(), keyed(&fixture, 2));
    play(&fixture, &mut rig, &keys, 10);
    let mut cage = between(&keys[0], &keys[1], 0.9);
    for _ in 0..10 {
        cage[3].z += 0.02 * fixture.size();
        rig.edit_rest_cage(&cage).expect("a valid cage");
        assert_near(&fixture, &mut rig, None, None);
    }
    assert_eq!(rig.work().rest_column_passes, 10);
    play(&fixture, &mut rig, &keys, 10);
}

#[test]
fn centers_and_16_bits_follow_shapes() {
    let fixture = character();
    let (keys, pose) = (keyed(&fixture, 2), fixtures::lively_pose(&fixture, 0.5));
    let moved = fixtures::distance(&keys[0], &keys[1]);
    for (precision, most) in
        [(Precision::Single, 2.0 * FRAME * fixture.size()), (Precision::Half, 4e-4 * moved)]
    {
        let mut rig = fixture.rig();
        rig.set_method(&METHODS[2]);
        rig.set_precision(precision);
        for frame in 0..20 {
            let cage = between(&keys[0], &keys[1], f64::from(frame) / 20.0);
            rig.play(&cage, &pose, None).expect("a valid frame");
            let found = fixtures::points(rig.posed_skin());
            let mut fresh = fixture.rig();
            fresh.set_method(&METHODS[2]);
            fresh.play(&cage, &pose, None).expect("a valid frame");
            let apart = fixtures::distance(&found, &fixtures::points(fresh.posed_skin()));
            assert!(apart <= most, "{precision:?}: {apart:e}");
        }
        let work = rig.work();
        assert!(work.rest_shape_passes >= 15 && work.center_shape_passes >= 15, "{work:?}");
    }
}

#[test]
fn frames_can_be_the_same_whatever_was_before_them() {
    let fixture = character();
    let (keys, pose) = (keyed(&fixture, 3), fixtures::lively_pose(&fixture, 0.5));
    let cage = between(&keys[1], &keys[2], 0.37);
    for method in METHODS {
        let mut fresh = fixture.rig();
        fresh.set_method(method);
        fresh.play(&cage, &pose, None).expect("a valid frame");
        let mut rig = fixture.rig();
        rig.set_method(method);
        play(&fixture, &mut rig, &keys, 12);
        rig.play(&cage, &pose, None).expect("a valid frame");
        rig.posed_skin();
        let shapes = rig.work().rest_shape_passes;
        rig.set_reproducible(true);
        for other in [0.9, 0.37, 0.36, 0.37] {
            rig.play(&between(&keys[1], &keys[2], other), &pose, None).expect("a valid frame");
            if other == 0.37 {
                assert!(rig.posed_skin() == fresh.posed_skin(), "{}", method.name);
            }
            let mut dragged = rig.rest_cage().to_vec();
            dragged[2].x += 0.01;
            rig.play(&dragged, &pose, None).expect("a valid frame");
            rig.posed_skin();
        }
        let work = rig.work();
        assert_eq!((work.rest_shape_passes, work.rest_column_passes), (shapes, 0));
        rig.set_reproducible(false);
        play(&fixture, &mut rig, &keys, 12);
        assert!(rig.work().rest_shape_passes > shapes);
    }
}
