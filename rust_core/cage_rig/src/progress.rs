//! Progress of long work: how far it is, for those who wait, and a wish to stop, for those who work.
//!
//! A [`Progress`] is shared by the thread that works and by those that watch. The work sees it as a
//! [`Part`] of the bar, which it splits by estimated costs, so that the bar moves evenly. Loops
//! count their units and learn so that they shall stop: [`Cancelled`] goes up to the door, and all
//! that was made is dropped on the way. A step costs two atomic additions; take one per millisecond.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use thiserror::Error;

/// Work was cancelled; nothing of it is left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the work was cancelled; nothing of it is left")]
pub struct Cancelled;

/// Does work that nobody watches, and that nobody can cancel therefore.
pub fn unwatched<T>(work: impl Fn(&Part) -> Result<T, Cancelled>) -> T {
    loop {
        if let Ok(done) = work(&Progress::default().whole()) {
            return done;
        }
    }
}

/// What is computed, in words for people, and the share of the work that was done before it.
pub type Stage = (&'static str, f64);

/// How far some work is, and whether it shall stop.
#[derive(Debug, Default)]
pub struct Progress {
    /// Bits of the share: those of positive numbers are in their order.
    share: AtomicU64,
    stages: Mutex<Vec<Stage>>,
    cancelled: AtomicBool,
}

impl Progress {
    /// The share that is done, 0 to 1. Never falls.
    pub fn share(&self) -> f64 {
        f64::from_bits(self.share.load(Relaxed))
    }

    /// What is being computed, in words for people; empty before the work begins.
    pub fn stage(&self) -> &'static str {
        self.stages().last().map_or("", |&(name, _)| name)
    }

    /// The stages that began, from the one of that number on; the last with the share that is done now.
    pub fn stages_from(&self, first: usize) -> Vec<Stage> {
        let stages = self.stages();
        let mut found = stages.get(first..).unwrap_or_default().to_vec();
        if let Some((_, share)) = found.last_mut() {
            *share = self.share();
        }
        found
    }

    fn stages(&self) -> MutexGuard<'_, Vec<Stage>> {
        self.stages.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.cancelled.store(true, Relaxed);
    }

    /// Whether the work was asked to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Relaxed)
    }

    /// All of the bar.
    pub fn whole(&self) -> Part<'_> {
        Part { progress: self, start: 0.0, end: 1.0 }
    }
}

/// A part of a bar, for a part of the work.
#[derive(Debug, Clone, Copy)]
pub struct Part<'a> {
    progress: &'a Progress,
    start: f64,
    end: f64,
}

impl<'a> Part<'a> {
    /// Parts one after the other, as long as their `costs`.
    pub fn split<const N: usize>(&self, costs: [f64; N]) -> [Part<'a>; N] {
        let total: f64 = costs.iter().sum();
        let scale = if total > 0.0 { (self.end - self.start) / total } else { 0.0 };
        let mut end = self.start;
        costs.map(|cost| {
            let start = end;
            end = (start + cost * scale).min(self.end);
            Part { progress: self.progress, start, end }
        })
    }

    /// Begins this part, which is called `stage`.
    pub fn begin(&self, stage: &'static str) -> Result<(), Cancelled> {
        self.progress.stages().push((stage, self.start));
        self.reach(0.0)
    }

    /// This part is done by `share`, 0 to 1.
    pub fn reach(&self, share: f64) -> Result<(), Cancelled> {
        let share = self.start + share.clamp(0.0, 1.0) * (self.end - self.start);
        self.progress.share.fetch_max(share.to_bits(), Relaxed);
        self.check()
    }

    /// Whether to go on.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.progress.is_cancelled() {
            Err(Cancelled)
        } else {
            Ok(())
        }
    }

    /// Counts to `units`, from any number of threads.
    pub fn count(&self, units: usize) -> Count<'a> {
        Count { part: *self, units: units.max(1), done: AtomicUsize::new(0) }
    }
}

/// Units of a part of the work.
#[derive(Debug)]
pub struct Count<'a> {
    part: Part<'a>,
    units: usize,
    done: AtomicUsize,
}

impl Count<'_> {
    /// So many more units are done.
    pub fn step(&self, units: usize) -> Result<(), Cancelled> {
        let done = self.done.fetch_add(units, Relaxed) + units;
        self.part.reach(done as f64 / self.units as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_fill_the_bar_by_their_costs() {
        let progress = Progress::default();
        let [a, b, c] = progress.whole().split([1.0, 0.0, 3.0]);
        assert_eq!(progress.stage(), "");
        a.begin("one").expect("not cancelled");
        let count = a.count(4);
        let mut seen = vec![progress.share()];
        for _ in 0..4 {
            count.step(1).expect("not cancelled");
            seen.push(progress.share());
        }
        assert_eq!(seen, [0.0, 0.0625, 0.125, 0.1875, 0.25]);
        b.begin("two").and_then(|()| c.begin("three")).expect("not cancelled");
        assert_eq!((progress.stage(), progress.share()), ("three", 0.25));
        assert_eq!(progress.stages_from(1), [("two", 0.25), ("three", 0.25)]);
        let [_, last] = c.split([1.0, 1.0]);
        last.reach(0.0).and_then(|()| last.reach(2.0)).expect("not cancelled");
        assert_eq!(progress.stages_from(2), [("three", 1.0)]);
        assert_eq!(progress.stages_from(3), []);
        a.reach(0.5).expect("not cancelled");
        assert_eq!(progress.share(), 1.0, "the share never falls");
    }

    #[test]
    fn nothing_to_do_is_done_at_once() {
        let progress = Progress::default();
        let [a, b] = progress.whole().split([0.0, 0.0]);
        a.count(0).step(1).and_then(|()| b.reach(1.0)).expect("not cancelled");
        assert_eq!(progress.share(), 0.0);
    }

    #[test]
    fn after_a_cancel_every_step_says_so() {
        let progress = Progress::default();
        let count = progress.whole().count(3);
        assert_eq!(count.step(1), Ok(()));
        progress.cancel();
        assert_eq!(count.step(1), Err(Cancelled));
        assert_eq!(progress.whole().begin("more"), Err(Cancelled));
        assert_eq!(progress.whole().check(), Err(Cancelled));
    }
}
