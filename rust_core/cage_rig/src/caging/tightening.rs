//! Tightening: pressure draws a cage that has grown close around the resting skin.
//!
//! First around a coarse stand-in, from afar and gently, then around the fine one. Faces that come out
//! narrow are pressed wider at the end. Cost: about two hundred rounds of two Newton steps.

use super::energy::Weights;
use super::inflation::{Inflation, InflationOptions, Resting, QUALITY, STEP};
use super::obstacle::StandIn;
use super::report::volume;
use crate::progress::{Cancelled, Part};

/// How a cage is tightened. The wider the barrier reaches and the less a round may bend the cage, the less of it
/// gets caught on what sticks out of the skin: both go down step by step.
pub(crate) struct Schedule {
    /// Of the barrier at first, in [`InflationOptions::reach`].
    reach: f64,
    /// And at last, in clearances.
    close: f64,
    /// For a tightness of 1.
    pressure: f64,
    /// Weight of the shape at first.
    shape: f64,
    /// The farthest anything moves in a round, in reaches of that round.
    step: f64,
    /// Part of [`InflationOptions::rounds`].
    rounds: f64,
    /// So many rounds before reach and shape fall.
    steady: usize,
}

/// Around the stand-in of growth, which has few triangles: from afar, and with so little pressure that
/// faces have time to find their places.
pub(crate) const DRAWN: Schedule =
    Schedule { reach: 2.0, close: 2.0, pressure: 0.3, shape: 0.1, step: 2.5, rounds: 1.0, steady: 16 };
/// Around the fine stand-in, from there.
pub(crate) const SETTLED: Schedule =
    Schedule { reach: 1.0, close: 1.5, pressure: 1.0, shape: LIMP, step: 0.75, rounds: 0.25, steady: 8 };

/// By what parts the reach of the barrier and the weight of the shape fall; the shape no lower than [`LIMP`].
const NEARER: f64 = 0.6;
const LIMPER: f64 = 0.5;
const LIMP: f64 = 2e-3;

/// A cage is tightened at most so many times longer, while its volume falls below this part in so many rounds.
const MORE: usize = 2;
const FALLING: f64 = 0.995;
const CHECKED: usize = 8;

/// A face with a smaller angle (degrees) is a sliver, and so often the weight against flat triangles
/// is raised to widen it.
const SLIVER: f64 = 7.0;
const HARDER: i32 = 5;
/// As long as every time widens the narrowest face by this factor.
const WIDER: f64 = 1.05;
/// The longest move that is none.
const STILL: f64 = 2e-5;

impl Inflation<'_> {
    /// Tightens the cage around a resting obstacle, to a gap of the clearance and the obstacle's margin.
    pub(crate) fn tighten(
        &mut self,
        obstacle: &StandIn,
        schedule: &Schedule,
        options: &InflationOptions,
        progress: &Part,
    ) -> Result<(), Cancelled> {
        let mut resting = Resting::new(obstacle, options);
        let close = schedule.close * options.clearance;
        let mut reach = (schedule.reach * options.reach).max(close);
        let (mut shape, mut limit) = (schedule.shape, f64::INFINITY);
        let rounds = (schedule.rounds * options.rounds as f64) as usize;
        let mut last = f64::INFINITY;
        for round in 0..MORE * rounds {
            progress.reach(round as f64 / rounds as f64)?;
            if round % CHECKED == 0 {
                let now = volume(&self.cage, &self.faces);
                if round >= rounds && now > FALLING * last {
                    break;
                }
                last = now;
            }
            let longest = (schedule.step * reach).max(0.1 * STEP);
            limit = limit.clamp(0.1 * longest, longest);
            let volume = schedule.pressure * options.tightness;
            let weights = Weights { volume, ..resting.weights(options, (reach, shape, QUALITY)) };
            let moved = self.press(&mut resting, None, weights, limit);
            limit = 3.0 * moved;
            if (round + 1) % schedule.steady == 0 {
                reach = (NEARER * reach).max(close);
                shape = (LIMPER * shape).max(LIMP);
            }
            if moved < STILL && reach <= 1.01 * close {
                break;
            }
        }
        Ok(())
    }

    /// Widens slivers of a tightened cage, pressing harder and harder against them. True when there
    /// were some.
    pub(crate) fn open_slivers(
        &mut self,
        obstacle: &StandIn,
        options: &InflationOptions,
        progress: &Part,
    ) -> Result<bool, Cancelled> {
        let mut resting = Resting::new(obstacle, options);
        for harder in 1..=HARDER {
            let narrowest = self.least_angle();
            if narrowest >= SLIVER {
                return Ok(harder > 1);
            }
            progress.reach(f64::from(harder - 1) / f64::from(HARDER))?;
            let shape = (4.0 * options.clearance, 0.05, QUALITY * 6.0_f64.powi(harder));
            for _ in 0..6 {
                let weights = resting.weights(options, shape);
                self.press(&mut resting, None, weights, STEP);
            }
            // What the skin keeps narrow: more weight would only blow up the rest.
            if self.least_angle() < WIDER * narrowest {
                break;
            }
        }
        Ok(true)
    }
}
