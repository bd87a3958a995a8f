//! No frame allocates after the first one: counted, all threads included.

mod common;

use cage_rig::skinning::METHODS;
use cage_rig::{CoupledRig, Point, Precision, Transform};
use common::random::{self, Recipe};
use common::{lively_pose, nudged, Fixture};
use stats_alloc::{Region, StatsAlloc, INSTRUMENTED_SYSTEM};
use std::alloc::System;

#[global_allocator]
static COUNTED: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// One frame as an add-on shows it.
fn frame(rig: &mut CoupledRig, cage: &[Point], pose: &[Transform]) {
    rig.play(cage, pose, None).expect("a valid frame");
    rig.posed_skin();
    rig.posed_cage();
    rig.rest_skin();
}

fn inputs(fixture: &Fixture) -> Vec<(Vec<Point>, Vec<Transform>)> {
    let moved = |k: u64| nudged(&fixture.cage, 0.01 * k as f64, k);
    (1..=12).map(|k| (moved(k), lively_pose(fixture, 0.1 * k as f64))).collect()
}

/// Allocations of `frames` after the first one.
fn allocations(rig: &mut CoupledRig, frames: &[(Vec<Point>, Vec<Transform>)]) -> usize {
    frame(rig, &frames[0].0, &frames[0].1);
    let region = Region::new(COUNTED);
    frames[1..].iter().for_each(|(cage, pose)| frame(rig, cage, pose));
    let counted = region.change();
    counted.allocations + counted.reallocations
}

/// In one test: what runs beside it would be counted too.
#[test]
fn frames_allocate_nothing_after_the_first_one() {
    let small = random::rig(Recipe { skin_vertices: 900, joints: 9, cage_level: 1, seed: 4 });
    let frames = inputs(&small);
    for method in METHODS {
        let mut rig = small.rig();
        rig.set_method(method);
        for precision in [Precision::Half, Precision::Single] {
            rig.set_precision(precision);
            assert_eq!(allocations(&mut rig, &frames), 0, "{} {precision:?}", method.name);
        }
        // A drag keeps its columns: only its first step allocates.
        let mut dragged = frames[11].clone();
        let region_of = |rig: &mut CoupledRig, dragged: &mut (Vec<Point>, Vec<Transform>)| {
            dragged.0[5].x += 0.01;
            let region = Region::new(COUNTED);
            frame(rig, &dragged.0, &dragged.1);
            region.change().allocations
        };
        assert!(region_of(&mut rig, &mut dragged) > 0);
        assert_eq!((0..20).map(|_| region_of(&mut rig, &mut dragged)).sum::<usize>(), 0);
        let drags = rig.work().rest_column_passes;
        assert_eq!(drags, 21);
        // Nor do the frames in which the shapes of a keyed cage are learnt.
        let keyed: Vec<_> = (1..=12)
            .map(|k| (nudged(&small.cage, 0.01 * f64::from(k), 1), lively_pose(&small, 0.5)))
            .collect();
        assert_eq!(allocations(&mut rig, &keyed), 0);
        assert!(rig.work().rest_shape_passes >= 10, "{:?}", rig.work());
    }
    // Large enough for threads: a thread that helps is told so in a block, up to three for the product and two for
    // skinning, and the pool takes one now and then.
    let large = random::rig(Recipe { skin_vertices: 20_000, joints: 9, cage_level: 1, seed: 5 });
    let frames = inputs(&large);
    let mut rig = large.rig();
    frame(&mut rig, &frames[0].0, &frames[0].1);
    let found = allocations(&mut rig, &frames);
    let most = 4 + 5 * (frames.len() - 1);
    assert!(found <= most, "{found} allocations in {} frames", frames.len() - 1);
}
