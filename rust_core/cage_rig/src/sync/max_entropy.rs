//! Maximum entropy coordinates: affine coordinates of a point, as close to given masses as can be.
//!
//! Based on [HS08] Hormann, Sukumar, *Maximum entropy coordinates for arbitrary polytopes*, as used
//! in [CTL*20] Eq. (11–12): maximise Σ −b_k ln(b_k / m_k) subject to Σ b_k c_k = a, Σ b_k = 1.
//! The dual is smooth and convex: b_k ∝ m_k exp(λ·(c_k − a)), λ minimises ln Σ m_k exp(λ·(c_k − a)).
//! Newton with backtracking, some ten iterations of `#C` work each. Outside the convex hull of the
//! cage there is no solution: then the affine coordinates closest to the masses are taken.

use crate::points::{bounding_diagonal, Matrix3, Point};

const ITERATIONS: usize = 200;
/// Where to stop, relative to the size. Newton overshoots it by far.
const TOLERANCE: f64 = 1e-13;
/// What still counts as solved when rounding stops the descent.
const ACCEPTED: f64 = 1e-10;
/// The smallest mass relative to the largest: every cage vertex can be reached.
const SMALLEST_MASS: f64 = 1e-12;

/// Coordinates of one point.
#[derive(Debug, Clone)]
pub struct MaxEntropy {
    /// b, one per cage vertex: sum 1, Σ b_k c_k = a.
    pub coords: Vec<f64>,
    /// False when the point is outside the convex hull of the cage.
    pub inside: bool,
    /// |Σ b_k c_k − a|, same unit as the cage.
    pub residual: f64,
    /// Newton steps taken.
    pub iterations: usize,
}

/// Coordinates of `point` with respect to `cage` (`#C by 3`), close to `masses` (one per cage
/// vertex, at least one positive; others count as very small).
pub fn max_entropy_coordinates(cage: &[Point], point: &Point, masses: &[f64]) -> MaxEntropy {
    let size = bounding_diagonal(cage);
    let largest = masses.iter().fold(0.0, |most: f64, m| most.max(*m));
    let masses: Vec<f64> = masses.iter().map(|m| (m / largest).max(SMALLEST_MASS)).collect();
    let arms: Vec<Point> = cage.iter().map(|c| (c - point) / size).collect();

    let mut slope = Point::zeros(); // λ
    let mut state = evaluate(&arms, &masses, &slope);
    let mut iterations = 0;
    while state.gradient.norm() > TOLERANCE && iterations < ITERATIONS && !separates(&arms, &slope) {
        let Some((next_slope, next)) = descend(&arms, &masses, &slope, &state) else { break };
        (slope, state) = (next_slope, next);
        iterations += 1;
    }
    let inside = state.gradient.norm() <= ACCEPTED;
    let mut coords = if inside { state.coords } else { normalised(masses) };
    restore(&arms, &mut coords);
    let residual = coords.iter().zip(cage).map(|(b, c)| *b * (c - point)).sum::<Point>().norm();
    MaxEntropy { coords, inside, residual, iterations }
}

/// The dual at λ: its value, gradient Σ b_k (c_k − a), Hessian, and the coordinates it gives.
struct Dual {
    value: f64,
    gradient: Point,
    hessian: Matrix3,
    coords: Vec<f64>,
}

fn evaluate(arms: &[Point], masses: &[f64], slope: &Point) -> Dual {
    let exponents: Vec<f64> = arms.iter().zip(masses).map(|(arm, m)| slope.dot(arm) + m.ln()).collect();
    let highest = exponents.iter().fold(f64::NEG_INFINITY, |most, e| most.max(*e));
    let mut coords: Vec<f64> = exponents.iter().map(|e| (e - highest).exp()).collect();
    let total: f64 = coords.iter().sum();
    coords.iter_mut().for_each(|b| *b /= total);
    let gradient: Point = coords.iter().zip(arms).map(|(b, arm)| *b * arm).sum();
    let hessian = coords.iter().zip(arms).map(|(b, arm)| *b * (arm - gradient) * (arm - gradient).transpose()).sum();
    Dual { value: highest + total.ln(), gradient, hessian, coords }
}

/// One Newton step, halved until the dual falls enough (Armijo). `None` when it cannot fall.
fn descend(arms: &[Point], masses: &[f64], slope: &Point, at: &Dual) -> Option<(Point, Dual)> {
    let damping = 1e-14 * at.hessian.trace();
    let step = -(at.hessian + Matrix3::identity() * damping).try_inverse()? * at.gradient;
    let descent = at.gradient.dot(&step);
    let mut length = 1.0;
    for _ in 0..60 {
        let next_slope = slope + length * step;
        let next = evaluate(arms, masses, &next_slope);
        // Near the minimum the value stands still in rounding; the gradient still tells.
        if next.value <= at.value + 1e-4 * length * descent || next.gradient.norm() < 0.5 * at.gradient.norm() {
            return Some((next_slope, next));
        }
        length *= 0.5;
    }
    None
}

/// λ·(c_k − a) < 0 for all k proves that a is outside the hull.
fn separates(arms: &[Point], slope: &Point) -> bool {
    arms.iter().all(|arm| slope.dot(arm) < 0.0)
}

fn normalised(mut masses: Vec<f64>) -> Vec<f64> {
    let total: f64 = masses.iter().sum();
    masses.iter_mut().for_each(|m| *m /= total);
    masses
}

/// The least-squares change that makes both constraints exact.
fn restore(arms: &[Point], coords: &mut [f64]) {
    for _ in 0..2 {
        let excess = 1.0 - coords.iter().sum::<f64>();
        coords.iter_mut().for_each(|b| *b += excess / arms.len() as f64);
        let middle = arms.iter().sum::<Point>() / arms.len() as f64;
        let spread: Matrix3 = arms.iter().map(|arm| (arm - middle) * (arm - middle).transpose()).sum();
        let miss: Point = coords.iter().zip(arms).map(|(b, arm)| *b * arm).sum();
        let Some(inverse) = spread.try_inverse() else { return };
        let change = inverse * miss;
        coords.iter_mut().zip(arms).for_each(|(b, arm)| *b -= change.dot(&(arm - middle)));
    }
}
