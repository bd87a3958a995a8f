//! What frames cost, and that drags do not drift.

use super::Work;
use crate::fixtures::{self, random, random::Random, Fixture};
use crate::points::Point;

use crate::skinning::METHODS;
use crate::sync::CoupledRig;

/// Relative to the size.
pub(super) const FRAME: f64 = 1e-6;

pub(super) fn character() -> Fixture {
    random::rig(random::Recipe { skin_vertices: 300, joints: 6, cage_level: 1, seed: 21 })
}

/// M₀ + m Φ (C − C₀) + offsets in double precision.
pub(super) fn exact(
    fixture: &Fixture,
    rig: &CoupledRig,
    mask: Option<&[f32]>,
    offsets: Option<&[Point]>,
) -> Vec<Point> {
    let moved: Vec<Point> = rig.rest_cage().iter().zip(&fixture.cage).map(|(c, c0)| c - c0).collect();
    let steps = rig.cage_coords().times(&moved);
    let part = |i: usize| mask.map_or(1.0, |mask| f64::from(mask[i]));
    let offset = |i: usize| offsets.map_or(Point::zeros(), |offsets| offsets[i]);
    (0..steps.len()).map(|i| fixture.skin[i] + part(i) * steps[i] + offset(i)).collect()
}

pub(super) fn assert_near(
    fixture: &Fixture,
    rig: &mut CoupledRig,
    mask: Option<&[f32]>,
    offsets: Option<&[Point]>,
) {
    let expected = exact(fixture, rig, mask, offsets);
    let apart = fixtures::distance(&fixtures::points(rig.rest_skin()), &expected);
    assert!(apart <= FRAME * fixture.size(), "{apart:e}");
}

#[test]
fn ten_thousand_drags_do_not_drift() {
    let fixture = character();
    let (mut rig, mut random) = (fixture.rig(), Random::new(1));
    let mut cage = fixture.cage.clone();
    rig.rest_skin();
    for step in 0..10_000 {
        // A vertex or two at a time, others every hundred steps.
        let first = step / 100 * 7 % cage.len();
        for vertex in [first, (first + 5) % cage.len()].into_iter().take(1 + step / 100 % 2) {
            cage[vertex] = fixture.cage[vertex] + random.point() * 0.3;
        }
        rig.edit_rest_cage(&cage).expect("a valid cage");
        rig.rest_skin();
        if step % 97 == 0 {
            assert_near(&fixture, &mut rig, None, None);
        }
    }
    assert_near(&fixture, &mut rig, None, None);
    let Work { rest_passes, rest_column_passes, .. } = rig.work();
    assert_eq!((rest_passes, rest_column_passes), (10_000, 10_000));
}

#[test]
fn a_drag_under_masks_and_offsets_stays_exact() {
    let fixture = character();
    let (mut rig, mut random) = (fixture.rig(), Random::new(2));
    let mut cage = fixture.cage.clone();
    for round in 0..30 {
        let mask: Option<Vec<f32>> =
            (round % 3 > 0).then(|| fixture.skin.iter().map(|_| random.unit() as f32).collect());
        rig.mask_skin(mask.as_deref()).expect("a valid mask");
        for step in 0..6 {
            let offsets: Option<Vec<Point>> =
                (step % 2 > 0).then(|| fixture.skin.iter().map(|_| random.point() * 0.1).collect());
            rig.offset_rest_skin(offsets.as_deref()).expect("valid offsets");
            cage[round % 4] += random.point() * 0.05;
            rig.edit_rest_cage(&cage).expect("a valid cage");
            assert_near(&fixture, &mut rig, mask.as_deref(), offsets.as_deref());
        }
    }
    let work = rig.work();
    assert!(work.rest_column_passes >= 30 * 5, "{work:?}");
}

#[test]
fn centers_follow_a_drag_by_columns_too() {
    let fixture = character();
    let mut random = Random::new(3);
    let (mut rig, mut cage) = (fixture.rig(), fixture.cage.clone());
    let pose = fixtures::lively_pose(&fixture, 0.5);
    rig.set_method(&METHODS[2]);
    rig.pose(&pose, None).expect("a valid pose");
    rig.posed_skin();
    for _ in 0..20 {
        cage[3] += random.point() * 0.05;
        rig.edit_rest_cage(&cage).expect("a valid cage");
        let dragged = fixtures::points(rig.posed_skin());
        let mut fresh = fixture.rig();
        fresh.set_method(&METHODS[2]);
        fresh.play(&cage, &pose, None).expect("a valid frame");
        let apart = fixtures::distance(&dragged, &fixtures::points(fresh.posed_skin()));
        assert!(apart <= 2.0 * FRAME * fixture.size(), "{apart:e}");
    }
    let work = rig.work();
    // The first pass of the centers moves nothing.
    assert_eq!((work.rest_column_passes, work.center_column_passes), (20, 21));
}

#[test]
fn what_is_given_again_costs_nothing() {
    let fixture = character();
    let pose = fixtures::lively_pose(&fixture, 0.7);
    for method in METHODS {
        let mut rig = fixture.rig();
        rig.set_method(method);
        let cage = fixtures::nudged(&fixture.cage, 0.1, 5);
        rig.play(&cage, &pose, None).expect("a valid frame");
        let first = (rig.posed_skin().to_vec(), rig.posed_cage().to_vec(), rig.work());
        for _ in 0..3 {
            rig.play(&cage, &pose, None).expect("a valid frame");
            rig.pose(&pose, None).expect("a valid pose");
            rig.edit_rest_cage(&cage).expect("a valid cage");
            assert_eq!((rig.posed_skin().to_vec(), rig.posed_cage().to_vec(), rig.work()), first);
        }
        // Bones alone: neither the rest skin nor its centers are made again.
        let other = fixtures::lively_pose(&fixture, 0.9);
        rig.pose(&other, None).expect("a valid pose");
        rig.posed_skin();
        let (before, after) = (first.2, rig.work());
        assert_eq!((after.rest_passes, after.center_passes), (before.rest_passes, before.center_passes));
        assert_eq!(after.skin_passes, before.skin_passes + 1);
    }
}

#[test]
fn every_path_and_precision_poses_alike() {
    use crate::panels::Precision;
    use crate::simd::Path;
    let fixture = character();
    let cage = fixtures::nudged(&fixture.cage, 0.3, 6);
    let pose = fixtures::lively_pose(&fixture, 0.7);
    let posed = |path, precision| {
        let mut input = fixture.input();
        (input.options.path, input.options.precision) = (path, precision);
        let mut rig = CoupledRig::new(input).expect("the fixture binds");
        rig.play(&cage, &pose, None).expect("a valid frame");
        fixtures::points(rig.posed_skin())
    };
    let expected = posed(Path::default(), Precision::Single);
    for path in Path::available() {
        let single = fixtures::distance(&posed(path, Precision::Single), &expected);
        assert!(single <= FRAME * fixture.size(), "{}: {single:e}", path.name());
        let half = fixtures::distance(&posed(path, Precision::Half), &expected);
        assert!(half > 0.0 && half <= 2e-4 * 0.3 * 3f64.sqrt(), "{}: {half:e}", path.name());
    }
}

#[test]
fn precision_can_be_changed_at_any_time() {
    use crate::panels::Precision::{Half, Single};
    let fixture = character();
    let (cage, pose) = (fixtures::nudged(&fixture.cage, 0.3, 6), fixtures::lively_pose(&fixture, 0.7));
    for method in METHODS {
        let bound = |precision| {
            let mut input = fixture.input();
            (input.options.precision, input.method) = (precision, method);
            let mut rig = CoupledRig::new(input).expect("the fixture binds");
            rig.play(&cage, &pose, None).expect("a valid frame");
            rig
        };
        let (mut single, mut half) = (bound(Single), bound(Half));
        let mut rig = bound(Single);
        for precision in [Half, Half, Single] {
            let expected = if precision == Half { &mut half } else { &mut single };
            rig.posed_skin();
            rig.set_precision(precision);
            assert_eq!(rig.precision(), precision);
            assert!(rig.posed_skin() == expected.posed_skin(), "{} {precision:?}", method.name);
            assert_eq!(rig.posed_cage(), expected.posed_cage());
            // And of a drag.
            let mut dragged = cage.clone();
            dragged[3].x += 0.01;
            for rig in [&mut rig, expected] {
                rig.edit_rest_cage(&dragged).expect("a valid cage");
                rig.posed_skin();
                rig.edit_rest_cage(&cage).expect("a valid cage");
            }
            let far = fixtures::distance(
                &fixtures::points(rig.posed_skin()),
                &fixtures::points(expected.posed_skin()),
            );
            assert!(far <= FRAME * fixture.size(), "{far:e}");
        }
    }
}

#[test]
fn posed_skins_are_what_playing_their_frames_shows() {
    let fixture = character();
    let mut random = Random::new(8);
    let poses: Vec<_> = (0..7).map(|seed| random::pose(&fixture, 0.5, seed)).collect();
    let moving: Vec<Vec<Point>> =
        (0..7).map(|seed| fixtures::nudged(&fixture.cage, 0.1 * random.unit(), seed)).collect();
    let still = vec![moving[2].clone(); 7];
    for (cages, passes) in [(&moving, 2), (&still, 1)] {
        for method in METHODS {
            let (mut rig, mut played) = (fixture.rig(), fixture.rig());
            rig.set_method(method);
            played.set_method(method);
            rig.offset_rest_skin(Some(&fixture.skin)).expect("valid offsets");
            played.offset_rest_skin(Some(&fixture.skin)).expect("valid offsets");
            let before = (rig.rest_cage().to_vec(), rig.transforms().to_vec());
            let mut out = vec![[f32::NAN; 3]; 7 * fixture.skin.len()];
            let frames: Vec<_> = cages.iter().zip(&poses).map(|(c, t)| (&c[..], &t[..])).collect();
            rig.posed_skins(&frames, None, &mut out).expect("valid frames");
            for ((cage, pose), found) in frames.iter().zip(out.chunks(fixture.skin.len())) {
                played.play(cage, pose, None).expect("a valid frame");
                assert_eq!(found, played.posed_skin(), "{}", method.name);
            }
            assert_eq!(rig.work().rest_passes, passes);
            assert_eq!(rig.work().center_passes, passes * usize::from(method.centers));
            assert_eq!((rig.rest_cage().to_vec(), rig.transforms().to_vec()), before);
        }
    }
}

#[test]
fn a_wrong_frame_is_refused_before_anything_is_written() {
    let fixture = character();
    let mut rig = fixture.rig();
    let pose = fixtures::lively_pose(&fixture, 0.5);
    let mut wrong = fixture.cage.clone();
    wrong[4].x = f64::NAN;
    let mut out = vec![[7.0f32; 3]; 2 * fixture.skin.len()];
    let frames = [(&fixture.cage[..], &pose[..]), (&wrong[..], &pose[..])];
    assert!(rig.posed_skins(&frames, None, &mut out).is_err());
    assert!(out.iter().flatten().all(|x| *x == 7.0));
}
