//! Long work: its bar grows to the end, it stops when it is told to, and watching it changes no bit.

mod common;

use cage_rig::skinning::method;
use cage_rig::sync::BindInput;
use cage_rig::{Cancelled, CoupledRig, Error, Point, Progress};
use common::large::snake;
use common::{all, lively_pose};
use std::thread;

/// Binds in a thread; cancels when the bar is at `cancel_at`. Returns the shares that were seen.
fn watched(input: &BindInput, cancel_at: f64) -> (Vec<f64>, Result<CoupledRig, Error>) {
    let progress = Progress::default();
    thread::scope(|scope| {
        let job = scope.spawn(|| CoupledRig::bind(input.clone(), &progress));
        let mut shares = Vec::new();
        while !job.is_finished() {
            shares.push(progress.share());
            if progress.share() >= cancel_at {
                progress.cancel();
            }
            thread::yield_now();
        }
        let result = job.join().expect("no panic");
        shares.push(progress.share());
        (shares, result)
    })
}

fn small() -> BindInput {
    snake(120, 24, 12, 9)
}

#[test]
fn the_bar_never_falls_and_ends_at_the_end() {
    let (shares, result) = watched(&small(), f64::INFINITY);
    assert!(result.is_ok());
    assert!(shares.windows(2).all(|pair| pair[0] <= pair[1]));
    assert!(shares[shares.len() - 1] > 1.0 - 1e-12, "{shares:?}");
    // How many a watcher gets to see is the scheduler's affair on a busy machine.
    let seen = shares.chunk_by(|a, b| a == b).count();
    assert!(seen > 5, "only {seen} different shares were seen");
}

#[test]
fn a_bind_stops_wherever_it_is_cancelled() {
    let input = small();
    let mut late = 0;
    for step in 0..40 {
        let at = f64::from(step) / 40.0;
        match watched(&input, at).1 {
            Ok(_) => late += 1, // the watcher was not given a turn in time
            Err(error) => assert_eq!(error, Error::Cancelled(Cancelled), "cancelled at {at}"),
        }
    }
    assert!(late < 20, "{late} of 40 were cancelled too late");
}

#[test]
fn watching_changes_no_bit() {
    for fixture in all() {
        for name in ["lbs", "cor"] {
            let input = || BindInput { method: method(name).expect("it is there"), ..fixture.input() };
            let pose = lively_pose(&fixture, 1.0);
            let progress = Progress::default();
            let mut rigs = [CoupledRig::new(input()), CoupledRig::bind(input(), &progress)]
                .map(|rig| rig.expect("the fixture binds"));
            rigs.iter_mut().for_each(|rig| rig.pose(&pose, None).expect("a pose"));
            let [a, b] = &mut rigs;
            assert_eq!(a.cage_coords(), b.cage_coords());
            assert_eq!(a.joint_coords(), b.joint_coords());
            assert_eq!(a.center_coords(), b.center_coords());
            assert_eq!((a.anchors(), a.report()), (b.anchors(), b.report()));
            assert_eq!(a.posed_skin(), b.posed_skin());
            assert_eq!(a.posed_cage(), b.posed_cage());
        }
    }
}

#[test]
fn centers_are_integrated_beside_a_rig_that_goes_on() {
    let cor = method("cor").expect("it is there");
    for fixture in all() {
        let (mut rig, mut at_once) = (fixture.rig(), fixture.rig());
        at_once.set_method(cor);
        let due = rig.due_centers(cor).expect("not needed until now");
        let cage: Vec<Point> = fixture.cage.iter().map(|c| c * 1.1).collect();
        let pose = lively_pose(&fixture, 0.7);
        let centers = thread::scope(|scope| {
            let progress = Progress::default();
            let job = scope.spawn(move || due.integrate(&progress.whole()));
            for rig in [&mut rig, &mut at_once] {
                rig.play(&cage, &pose, None).expect("a pose");
            }
            job.join().expect("no panic").expect("nobody cancels")
        });
        assert!(rig.center_coords().is_none() && rig.method().name == "lbs");
        rig.take_centers(centers);
        assert!(rig.due_centers(cor).is_none() && rig.method().name == "lbs");
        rig.set_method(cor);
        assert_eq!(rig.posed_skin(), at_once.posed_skin(), "{}", fixture.name);
        assert_eq!(rig.work().center_integrations, 1);
    }
}

#[test]
fn cancelled_centers_leave_the_rig_as_it_was() {
    let input = BindInput { method: method("lbs").expect("it is there"), ..small() };
    let mut rig = CoupledRig::new(input).expect("the snake binds");
    let before = rig.posed_skin().to_vec();
    let due = rig.due_centers(method("cor").expect("it is there")).expect("not needed until now");
    let progress = Progress::default();
    progress.cancel();
    assert_eq!(due.integrate(&progress.whole()).map(|_| ()), Err(Cancelled));
    assert!(rig.center_coords().is_none());
    assert_eq!(rig.posed_skin(), before);
}
