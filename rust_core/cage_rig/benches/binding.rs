//! What binding costs, and how its bar moves: `cargo bench -p cage_rig --bench binding`.
//!
//! - rows: synthetic tubes of the sizes of [CTL*20] Table 1, and one of 500,000 vertices under a cage of 200. Of the
//!   paper's columns only one is at hand: its joint coordinates of the largest rig took 46.8 s.
//! - parts: what coordinates, anchors and joint coordinates of the largest of them take alone.
//! - drag: the first edit of the posed cage after a pose and the next ones, with few joints bent and with all.
//! - snake: 119,802 vertices, 98 joints, a cage of 44; the paper's largest rig.
//! - worm: 24,000 vertices, 52 joints, a cage of 120; a fine cage on a character for games.
//!
//! The last two are bound for a method with centers of rotation, once in peace and then cancelled at many times. Printed are the
//! stages with their share of the time and of the bar, how far the bar is ever from the time, and how long a cancel takes.
//! Times are the best of some, without centers unless said.
#![allow(clippy::print_stdout, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use cage_rig::coordinates::mean_value;
use cage_rig::skinning::method;
use cage_rig::sync::maxvol::{maxvol, MaxVolOptions};
use cage_rig::sync::BindInput;
use cage_rig::{unwatched, CoupledRig, Error, Point, Progress, Transform};
use common::large::snake;
use std::time::{Duration, Instant};

/// Seconds since the start, share and stage, as a watcher sees them.
type Seen = (f64, f64, &'static str);

fn watched(input: &BindInput, cancel_at: Option<f64>) -> (Vec<Seen>, f64, Result<CoupledRig, Error>) {
    let progress = Progress::default();
    let input = input.clone();
    std::thread::scope(|scope| {
        let start = Instant::now();
        let job = scope.spawn(|| CoupledRig::bind(input, &progress));
        let (mut seen, mut cancelled) = (Vec::new(), None);
        while !job.is_finished() {
            let now = start.elapsed().as_secs_f64();
            seen.push((now, progress.share(), progress.stage()));
            if cancelled.is_none() && cancel_at.is_some_and(|at| now >= at) {
                progress.cancel();
                cancelled = Some(now);
            }
            std::thread::sleep(Duration::from_micros(if cancelled.is_some() { 100 } else { 2000 }));
        }
        let end = start.elapsed().as_secs_f64();
        (seen, end - cancelled.unwrap_or(0.0), job.join().expect("no panic"))
    })
}

fn scenario(name: &str, input: &BindInput) {
    let (seen, total, result) = watched(input, None);
    assert!(result.is_ok_and(|mut rig| rig.posed_skin().iter().flatten().all(|x| x.is_finite())));
    println!("{name}: {total:.2} s");
    for group in seen.chunk_by(|a, b| a.2 == b.2) {
        let (first, last) = (group[0], group[group.len() - 1]);
        let (time, bar) = (100.0 * (last.0 - first.0) / total, 100.0 * (last.1 - first.1));
        println!("  {:26} {time:5.1} % of the time, {bar:5.1} % of the bar", first.2);
    }
    let off = seen.iter().map(|(now, share, _)| (now / total - share).abs()).fold(0.0, f64::max);
    let still =
        seen.chunk_by(|a, b| a.1 == b.1).map(|same| same[same.len() - 1].0 - same[0].0).fold(0.0, f64::max);
    println!(
        "  off by {:.0} % of the bar at most; stands still for {:.0} ms at most",
        100.0 * off,
        1e3 * still
    );
    let mut worst = (0.0, "");
    for step in 1..12 {
        let (seen, latency, result) = watched(input, Some(total * f64::from(step) / 12.0));
        assert!(result.is_ok() || matches!(result, Err(Error::Cancelled(_))));
        let stage = seen.last().map_or("", |(_, _, stage)| stage);
        if result.is_err() && latency > worst.0 {
            worst = (latency, stage);
        }
    }
    println!("  a cancel takes {:.0} ms at most ({})", 1e3 * worst.0, worst.1);
}

/// The best time of `times` tries of `work`, in milliseconds, and its last result.
fn best<T>(times: usize, mut work: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let start = Instant::now();
        let result = work();
        (1e3 * start.elapsed().as_secs_f64(), result)
    };
    let (mut least, mut result) = timed();
    for _ in 1..times {
        let (time, next) = timed();
        (least, result) = (least.min(time), next);
    }
    (least, result)
}

/// `rings` of `around` vertices, `joints`, `cage_rings` of four; what the paper took, where that is known.
type Row = (usize, usize, usize, usize, &'static str);

const ROWS: [Row; 7] = [
    (87, 24, 24, 7, ""),
    (87, 24, 24, 20, ""),
    (164, 40, 64, 26, ""),
    (313, 24, 64, 22, ""),
    (1657, 25, 19, 17, ""),
    (1464, 82, 98, 11, "more than 46,800 ms"),
    (5000, 100, 100, 50, "none"),
];

fn rows() {
    for (rings, around, joints, cage_rings, paper) in ROWS {
        let mut input = snake(rings, around, joints, cage_rings);
        input.method = method("lbs").expect("it is there");
        let times = if rings > 4000 { 1 } else { 5 };
        let (time, rig) = best(times, || CoupledRig::new(input.clone()).expect("a tube binds"));
        let report = rig.report();
        assert!(
            report.coordinate_error_max <= 1e-12 * rig.size() && report.joint_error_max <= 1e-10 * rig.size()
        );
        assert!(report.anchor_max_ratio <= 1.05);
        let (vertices, cage) = (rings * around, 4 * cage_rings);
        println!("row {vertices} / {joints} / {cage}: {time:.1} ms; the paper: {paper}");
    }
}

fn parts() {
    let input = snake(1464, 82, 98, 11);
    let (points, cage) = (&input.skin_vertices, &input.cage);
    let (time, coords) = best(9, || unwatched(|part| mean_value::coordinates(cage, points, part)));
    let found = coords.times(cage.vertices());
    let miss = found.iter().zip(points).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(miss < 1e-12 * 98.0);
    println!("coordinates of {} points in {} faces: {time:.1} ms", points.len(), cage.triangles().len());
    let (time, chosen) = best(9, || unwatched(|part| maxvol(&coords, &MaxVolOptions::default(), part)));
    assert!(chosen.ratio <= 1.05);
    println!("anchors: {time:.1} ms, {} swaps", chosen.swaps);
}

/// Every joint from `bent` on is turned a little more than its parent.
fn drag(name: &str, input: BindInput, bent: usize) {
    let input = BindInput { method: method("lbs").expect("it is there"), ..input };
    let mut rig = CoupledRig::new(input).expect("a tube binds");
    let joints = rig.joints().to_vec();
    let mut first = f64::INFINITY;
    let mut next = f64::INFINITY;
    for round in 1..=20 {
        let mut pose = vec![Transform::identity(); joints.len()];
        for j in 1..joints.len() {
            let turn = if j > joints.len() / 2 && j <= joints.len() / 2 + bent {
                0.02 + 0.001 * f64::from(round)
            } else {
                0.0
            };
            let local = common::turn(joints[j], Point::new(0.2, 0.1, 1.0), turn);
            pose[j] = common::compose(&pose[j - 1], &local);
        }
        rig.pose(&pose, None).expect("a pose");
        for edit in 0..10 {
            let wanted: Vec<Point> = rig.posed_cage().iter().map(|c| c * 1.001).collect();
            let start = Instant::now();
            rig.edit_posed_cage(&wanted).expect("a solvable pose");
            let time = 1e3 * start.elapsed().as_secs_f64();
            if edit == 0 {
                first = first.min(time);
            } else {
                next = next.min(time);
            }
        }
    }
    let work = rig.work();
    println!(
        "drag {name}: first edit {first:.3} ms, next ones {next:.3} ms; {} of {} factorisations by low rank, {} attenuated",
        work.reverse_low_rank,
        work.reverse_factorisations,
        rig.report().regularised
    );
}

fn main() {
    parts();
    drag("104 / 64, 5 bent", snake(164, 40, 64, 26), 5);
    drag("104 / 64, all bent", snake(164, 40, 64, 26), 31);
    drag("352 / 64, 10 bent", snake(400, 60, 64, 88), 10);
    rows();
    scenario("snake", &snake(1461, 82, 98, 11));
    scenario("worm", &snake(400, 60, 52, 30));
}
