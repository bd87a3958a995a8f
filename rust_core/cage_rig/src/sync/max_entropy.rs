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
/// Added to the Hessian of the unit-sized problem.
const DAMPING: f64 = 1e-12;
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
    let coords = if inside { state.coords } else { closest_affine(&arms, normalised(masses)) };
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
    let hessian =
        coords.iter().zip(arms).map(|(b, arm)| *b * (arm - gradient) * (arm - gradient).transpose()).sum();
    Dual { value: highest + total.ln(), gradient, hessian, coords }
}

/// One Newton step, halved until the dual falls enough (Armijo). `None` when it cannot fall.
fn descend(arms: &[Point], masses: &[f64], slope: &Point, at: &Dual) -> Option<(Point, Dual)> {
    // The Hessian vanishes while one vertex has nearly all the mass: the step is then along the gradient.
    let step = -(at.hessian + Matrix3::identity() * DAMPING).try_inverse()? * at.gradient;
    let descent = at.gradient.dot(&step);
    let mut length = 1.0;
    for _ in 0..60 {
        let next_slope = slope + length * step;
        let next = evaluate(arms, masses, &next_slope);
        // Near the minimum the value stands still in rounding; the gradient still tells.
        if next.value <= at.value + 1e-4 * length * descent || next.gradient.norm() < 0.5 * at.gradient.norm()
        {
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

/// The affine coordinates with the least squared distance to `masses`: Σ b_k = 1 is kept, and the
/// change is affine in c_k.
fn closest_affine(arms: &[Point], mut masses: Vec<f64>) -> Vec<f64> {
    let middle = arms.iter().sum::<Point>() / arms.len() as f64;
    let spread: Matrix3 = arms.iter().map(|arm| (arm - middle) * (arm - middle).transpose()).sum();
    let Some(inverse) = spread.try_inverse() else { return masses };
    // Twice: the second pass takes away what rounding left of the first.
    for _ in 0..2 {
        let miss: Point = masses.iter().zip(arms).map(|(b, arm)| *b * arm).sum();
        let change = inverse * miss;
        masses.iter_mut().zip(arms).for_each(|(b, arm)| *b -= change.dot(&(arm - middle)));
        let excess = (masses.iter().sum::<f64>() - 1.0) / arms.len() as f64;
        masses.iter_mut().for_each(|b| *b -= excess);
    }
    masses
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{random::Random, shapes::icosphere};

    fn solve(point: Point, masses: &[f64]) -> (MaxEntropy, f64) {
        let (cage, _) = icosphere(1);
        let found = max_entropy_coordinates(&cage, &point, masses);
        assert!((found.coords.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let place: Point = found.coords.iter().zip(&cage).map(|(b, c)| *b * c).sum();
        let miss = (place - point).norm();
        assert!((miss - found.residual).abs() < 1e-12);
        (found, miss)
    }

    #[test]
    fn inside_the_hull_both_constraints_hold_whatever_the_masses() {
        let mut random = Random::new(6);
        for round in 0..200 {
            let masses: Vec<f64> = (0..42).map(|_| 10f64.powf(random.between(-12.0, 0.0))).collect();
            let (found, miss) = solve(random.point() * 0.5, &masses);
            assert!(found.inside && miss < 1e-12, "round {round}: {miss:e} after {}", found.iterations);
            assert!(found.coords.iter().all(|b| *b > -1e-15));
        }
    }

    #[test]
    fn masses_that_already_fit_are_kept() {
        let mut masses = vec![0.5; 42];
        masses[3] = 7.0;
        let (cage, _) = icosphere(1);
        let total: f64 = masses.iter().sum();
        let center: Point = masses.iter().zip(&cage).map(|(m, c)| *m / total * c).sum();
        let (found, _) = solve(center, &masses);
        assert!(found.coords.iter().zip(&masses).all(|(b, m)| (b - m / total).abs() < 1e-13));
    }

    #[test]
    fn of_all_coordinates_the_ones_nearest_to_the_masses_are_found() {
        let (cage, _) = icosphere(1);
        let masses: Vec<f64> = (0..42).map(|k| 1.0 + (k as f64).sin()).collect();
        let (found, _) = solve(Point::new(0.2, -0.3, 0.4), &masses);
        // At the maximum ln(b_k / m_k) is affine in c_k.
        let logs: Vec<f64> = found.coords.iter().zip(&masses).map(|(b, m)| (b / m).ln()).collect();
        let slope = Matrix3::from_rows(&[13, 20, 37].map(|k: usize| (cage[k] - cage[0]).transpose()))
            .try_inverse()
            .expect("four vertices in general position")
            * Point::new(logs[13] - logs[0], logs[20] - logs[0], logs[37] - logs[0]);
        for (log, c) in logs.iter().zip(&cage) {
            assert!((log - logs[0] - slope.dot(&(c - cage[0]))).abs() < 1e-9);
        }
    }

    #[test]
    fn outside_the_hull_both_constraints_still_hold_and_it_is_said() {
        for distance in [1.01, 1.5, 30.0] {
            let (found, miss) = solve(Point::new(0.0, distance, 0.3), &[1.0; 42]);
            assert!(!found.inside && miss < 1e-12, "{miss:e}");
        }
    }
}
