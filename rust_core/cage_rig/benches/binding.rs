//! What binding costs, and how its bar moves: `cargo bench -p cage_rig --bench binding`.
//!
//! - snake: 119,802 vertices, 98 joints, a cage of 44; the paper's largest rig.
//! - worm: 24,000 vertices, 52 joints, a cage of 120; a fine cage on a character for games.
//!
//! Each is bound for a method with centers of rotation, once in peace and then cancelled at many times. Printed are the
//! stages with their share of the time and of the bar, how far the bar is ever from the time, and how long a cancel takes.
#![allow(clippy::print_stdout, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use cage_rig::sync::BindInput;
use cage_rig::{CoupledRig, Error, Progress};
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

fn main() {
    scenario("snake", &snake(1461, 82, 98, 11));
    scenario("worm", &snake(400, 60, 52, 30));
}
