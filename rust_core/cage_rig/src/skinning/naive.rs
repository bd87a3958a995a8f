//! Oracles: each method straight from its equation, in double precision.

use crate::points::{Point, Transform};
use crate::rows::Rows;

/// M′ from T, Ω (`#M by #J`, rows that sum to 1 or 0) and M.
pub(crate) type Oracle = fn(&[Transform], &Rows, &[Point]) -> Vec<Point>;

/// The oracle of each method in `METHODS`.
pub(crate) const ORACLES: &[(&str, Oracle)] = &[("lbs", lbs)];

/// [CTL*20] Eq. (3): v′ = Σ_j ω_ij (R_j v + t_j); a row of zeros leaves its vertex alone.
pub(crate) fn lbs(transforms: &[Transform], weights: &Rows, rest: &[Point]) -> Vec<Point> {
    let mut posed = Vec::new();
    for (i, v) in rest.iter().enumerate() {
        let mut moved = Point::zeros();
        for (j, t) in transforms.iter().enumerate() {
            moved += weights.row(i)[j] * (t.linear * v + t.translation);
        }
        posed.push(if weights.row(i).iter().all(|w| *w == 0.0) { *v } else { moved });
    }
    posed
}
