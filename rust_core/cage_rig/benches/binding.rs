//! What binding costs, and how its bar moves: `cargo bench -p cage_rig --bench binding`.
//!
//! - rows: synthetic tubes of the sizes of [CTL*20] Table 1, and one of 500,000 vertices under a cage of 200. Of the
//!   paper's columns only one number is at hand: its joint coordinates of the largest rig took 46.8 s. They are an
//!   integral over all faces for every joint, so beside the other sizes stands what that makes for them.
//! - parts: what coordinates, anchors and joint coordinates of the largest of them take alone.
//! - refresh: Eq. (19) for another pose, which the first edit waits for, by low rank beside the full LU, and by the latter alone.
//! - drag: the first edit of the posed cage after a pose and the next ones, with few joints bent, with half and with all.
//! - snake: 119,802 vertices, 98 joints, a cage of 44; the paper's largest rig.
//! - worm: 24,000 vertices, 52 joints, a cage of 120; a fine cage on a character for games.
//!
//! The last two are bound for a method with centers of rotation, once in peace and then cancelled at many times. Printed are the
//! stages with their share of the time and of the bar, how far the bar is ever from the time, and how long a cancel takes.
//! Times are the best of some, without centers unless said. Lines that begin with `row` are for the table of `make bench`.
#![allow(clippy::print_stdout, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use cage_rig::coordinates::mean_value;
use cage_rig::skinning::method;
use cage_rig::sync::cage_reverser::CageReverser;
use cage_rig::sync::cage_updater::CageUpdater;
use cage_rig::sync::joint_coordinates::{joint_coordinates, SkinAtRest};
use cage_rig::sync::maxvol::{maxvol, MaxVolOptions};
use cage_rig::sync::skeleton_updater::SkeletonUpdater;
use cage_rig::sync::BindInput;
use cage_rig::{unwatched, CoupledRig, Error, Matrix3, Point, Progress, Transform};
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

/// `rings` of `around` vertices, `joints`, `cage_rings` of four.
type Row = (usize, usize, usize, usize);

const LARGEST: Row = (1464, 82, 98, 11);
const ROWS: [Row; 7] = [
    (87, 24, 24, 7),
    (87, 24, 24, 20),
    (164, 40, 64, 26),
    (313, 24, 64, 22),
    (1657, 25, 19, 17),
    LARGEST,
    (5000, 100, 100, 50),
];
/// Milliseconds that joint coordinates of the largest rig took in the paper, on its machine.
const PAPER: f64 = 46_800.0;

/// What a bind of this size stands beside, and what that took.
fn beside(row: Row) -> Option<(f64, &'static str)> {
    let work = |(rings, around, joints, _): Row| ((rings - 1) * around * joints) as f64;
    match row {
        LARGEST => Some((PAPER, "joint coordinates alone in [CTL*20], its machine")),
        (5000, ..) => None,
        _ => {
            let label = "joint coordinates alone at the pace of [CTL*20]'s largest rig (estimated)";
            Some((PAPER * work(row) / work(LARGEST), label))
        }
    }
}

/// The most memory that this process has had so far, in GB; none where the system does not say (Linux does).
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kilobytes| kilobytes * 1024.0 / 1e9)
}

fn rows() {
    for row in ROWS {
        let (rings, around, joints, cage_rings) = row;
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
        let (paper, beside) = beside(row).map_or(("-".into(), "-"), |(ms, label)| (ms.to_string(), label));
        let why = match peak_memory().filter(|_| rings > 4000) {
            Some(peak) => {
                assert!(peak < 3.0, "{peak} GB");
                format!("a character in close-up; the process had {peak:.1} GB at most")
            }
            None if rings > 4000 => "a character in close-up".to_owned(),
            None => "a size of [CTL*20] Table 1".to_owned(),
        };
        println!(
            "row\tbind: {vertices} vertices, {joints} bones, cage of {cage}\t{why}\t{time}\t{paper}\t{beside}\t-"
        );
    }
}

fn parts() {
    let input = snake(1464, 82, 98, 11);
    let (points, cage) = (&input.skin_vertices, &input.cage);
    let (time, coords) = best(9, || unwatched(|part| mean_value::coordinates(cage, points, part)));
    let found = coords.times(cage.vertices());
    let miss = found.iter().zip(points).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(miss < 1e-12 * 98.0);
    let (faces, sample) = (cage.triangles(), points.iter().step_by(40).copied().collect::<Vec<_>>());
    let (plain, _) = best(3, || sample.iter().map(|p| as_printed(p, cage.vertices(), faces)[0]).sum::<f64>());
    let plain = plain * points.len() as f64 / sample.len() as f64;
    println!(
        "row\tcoordinates: {} points, {} faces\tmost of a bind\t{time}\t{plain}\tthe formula of [JSW05] as printed, one thread\t-",
        points.len(),
        faces.len()
    );
    let (time, chosen) = best(9, || unwatched(|part| maxvol(&coords, &MaxVolOptions::default(), part)));
    assert!(chosen.ratio <= 1.05);
    println!("anchors: {} swaps", chosen.swaps);
    println!("row\tanchors: {} by {}\tonce a bind\t{time}\t-\t-\t-", coords.len(), coords.columns());
    let joints = input.skeleton.joints();
    let quads = input.skin_faces.iter().map(|face| face.iter().map(|v| *v as u32).collect::<Vec<_>>());
    let triangles: Vec<[u32; 3]> = quads.flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    let reach = vec![1.0; points.len()];
    let (triangles, weights) = (&triangles[..], &input.skin_weights);
    let skin = SkinAtRest { vertices: points, triangles, weights, cage_coords: &coords, reach: &reach };
    let (time, found) = best(3, || unwatched(|part| joint_coordinates(cage, &skin, joints, 0.1, part)));
    let found = found.coords.times(cage.vertices());
    let miss = found.iter().zip(joints).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(miss < 1e-9 * 98.0);
    println!(
        "row\tjoint coordinates: {} joints, {} faces\tthe slowest part of the paper's bind\t{time}\t{PAPER}\t[CTL*20], its machine\t-",
        joints.len(),
        triangles.len()
    );
}

/// Mean value weights by the formula of [JSW05] Figure 4 as printed: an angle and an inverse cosine a corner.
fn as_printed(point: &Point, vertices: &[Point], faces: &[[u32; 3]]) -> Vec<f64> {
    let mut weights = vec![0.0; vertices.len()];
    for face in faces {
        let arms = face.map(|v| vertices[v as usize] - point);
        let far = arms.map(|arm| arm.norm());
        let u = [arms[0] / far[0], arms[1] / far[1], arms[2] / far[2]];
        let angle: [f64; 3] =
            std::array::from_fn(|k| 2.0 * ((u[(k + 1) % 3] - u[(k + 2) % 3]).norm() / 2.0).asin());
        let half = angle.iter().sum::<f64>() / 2.0;
        let sign = u[0].cross(&u[1]).dot(&u[2]).signum();
        let c: [f64; 3] = std::array::from_fn(|k| {
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            2.0 * half.sin() * (half - angle[k]).sin() / (angle[next].sin() * angle[last].sin()) - 1.0
        });
        let s = c.map(|c| sign * (1.0 - c * c).max(0.0).sqrt());
        for k in 0..3 {
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            let weight = (angle[k] - c[next] * angle[last] - c[last] * angle[next])
                / (far[k] * angle[next].sin() * s[last]);
            weights[face[k] as usize] += if weight.is_finite() { weight } else { 0.0 };
        }
    }
    weights
}

/// The `bent` joints in the middle are turned against their parents, a little more in every round.
fn bent_pose(joints: &[Point], bent: usize, round: u32) -> Vec<Transform> {
    let mut pose = vec![Transform::identity(); joints.len()];
    let first = (joints.len() - bent).div_ceil(2);
    for j in 1..joints.len() {
        let turn = if (first..first + bent).contains(&j) { 0.02 + 0.001 * f64::from(round) } else { 0.0 };
        let local = common::turn(joints[j], Point::new(0.2, 0.1, 1.0), turn);
        pose[j] = common::compose(&pose[j - 1], &local);
    }
    pose
}

/// What Eq. (19) takes for another pose, as it is chosen, and by the full LU.
fn refresh(name: &str, input: &BindInput, bent: usize) {
    let rig = CoupledRig::new(BindInput { method: method("lbs").expect("it is there"), ..input.clone() })
        .expect("a tube binds");
    let reach = vec![1.0; input.skin_vertices.len()];
    let skin = SkinAtRest {
        vertices: &input.skin_vertices,
        triangles: &[],
        weights: &input.skin_weights,
        cage_coords: rig.cage_coords(),
        reach: &reach,
    };
    let (cage, limit) = (rig.cage().vertices(), input.options.min_singular);
    let updater = unwatched(|part| CageUpdater::new(rig.anchors(), &skin, cage, limit, part));
    let skeleton = SkeletonUpdater::new(input.skeleton.clone(), rig.joint_coords().clone());
    let linear: Vec<Matrix3> = bent_pose(rig.joints(), bent, 1).iter().map(|t| t.linear).collect();
    let shares = vec![1.0; linear.len()];
    let (mut chosen_time, mut dense_time) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..40 {
        let (time, chosen) = best(1, || CageReverser::new(&updater, &skeleton, &linear, &shares));
        chosen_time = chosen_time.min(time);
        let (time, dense) = best(1, || CageReverser::dense(&updater, &skeleton, &linear, &shares));
        dense_time = dense_time.min(time);
        let (chosen, dense) = (chosen.expect("a solvable pose"), dense.expect("a solvable pose"));
        assert_eq!(chosen.is_low_rank(), 3 * bent <= cage.len());
        let step: Vec<Point> = cage.iter().map(|c| c * 1e-3).collect();
        let (found, expected) = (chosen.solve(&updater, &step), dense.solve(&updater, &step));
        let miss = found.iter().zip(&expected).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(miss < 1e-9 * rig.size(), "{miss}");
    }
    let (what, peer, beside) = if 3 * bent <= cage.len() {
        ("low rank", dense_time.to_string(), "the full LU")
    } else {
        ("full LU", "-".to_owned(), "-")
    };
    let why = "the first edit after a pose waits for it";
    println!(
        "row\trefresh of the posed cage's edits, {what}: {name}\t{why}\t{chosen_time}\t{peer}\t{beside}\t-"
    );
    println!("refresh {name}: {chosen_time:.3} ms by {what}, full LU {dense_time:.3} ms");
}

fn drag(name: &str, input: BindInput, bent: usize) {
    let input = BindInput { method: method("lbs").expect("it is there"), ..input };
    let mut rig = CoupledRig::new(input).expect("a tube binds");
    let joints = rig.joints().to_vec();
    let mut first = f64::INFINITY;
    let mut next = f64::INFINITY;
    for round in 1..=20 {
        let pose = bent_pose(&joints, bent, round);
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
    for (what, time) in [("first edit after a pose", first), ("next edits", next)] {
        println!("row\t{what}, posed cage: {name}\ta drag waits for it\t{time}\t-\t-\t-");
    }
    println!(
        "drag {name}: first edit {first:.3} ms, next ones {next:.3} ms; {} of {} factorisations by low rank, {} attenuated",
        work.reverse_low_rank,
        work.reverse_factorisations,
        rig.report().regularised
    );
}

fn main() {
    parts();
    for bent in [5, 10, 63] {
        refresh(&format!("cage of 104, {bent} of 64 joints bent"), &snake(164, 40, 64, 26), bent);
    }
    for bent in [5, 31, 63] {
        drag(&format!("cage of 104, {bent} of 64 joints bent"), snake(164, 40, 64, 26), bent);
    }
    drag("cage of 352, 10 of 64 joints bent", snake(400, 60, 64, 88), 10);
    rows();
    scenario("snake", &snake(1461, 82, 98, 11));
    scenario("worm", &snake(400, 60, 52, 30));
}
