//! How far may four points move before a gap closes? Additive continuous collision detection.
//!
//! Two kinds of gaps between triangles: a point and a triangle, two edges. The way is walked in
//! steps that can't use up the gap left, so no root of a cubic is needed and no case is missed
//! (Li, Kaufman, Jiang: *Codimensional Incremental Potential Contact*, 2021, §5).

use super::distance::{nearest_on_segments, nearest_on_triangle};
use crate::points::Point;

/// Which features face each other across a gap of four points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gap {
    /// The first point and the triangle of the others.
    PointTriangle,
    /// The segment of the first two and that of the last two.
    EdgeEdge,
}

/// Signed weights of the four points: their combination spans the gap at its narrowest.
pub fn weights(gap: Gap, x: &[Point; 4]) -> [f64; 4] {
    match gap {
        Gap::PointTriangle => {
            let [u, v, w] = nearest_on_triangle(&x[0], [&x[1], &x[2], &x[3]]);
            [1.0, -u, -v, -w]
        }
        Gap::EdgeEdge => {
            let (s, t) = nearest_on_segments([&x[0], &x[1]], [&x[2], &x[3]]);
            [1.0 - s, s, t - 1.0, -t]
        }
    }
}

/// The vector across the gap, given its [`weights`].
pub fn across(weights: &[f64; 4], x: &[Point; 4]) -> Point {
    x[0] * weights[0] + x[1] * weights[1] + x[2] * weights[2] + x[3] * weights[3]
}

/// Width of the gap.
pub fn width(gap: Gap, x: &[Point; 4]) -> f64 {
    across(&weights(gap, x), x).norm()
}

/// The largest part (0 to 1) of the moves `moves` after which the gap is still wider than
/// `least` by a fifth of what it now is.
pub fn free_part(gap: Gap, start: &[Point; 4], moves: &[Point; 4], least: f64) -> f64 {
    let mean = (moves[0] + moves[1] + moves[2] + moves[3]) * 0.25;
    let moves = moves.map(|m| m - mean);
    let lengths = moves.map(|m| m.norm());
    let speed = match gap {
        Gap::PointTriangle => lengths[0] + lengths[1].max(lengths[2]).max(lengths[3]),
        Gap::EdgeEdge => lengths[0].max(lengths[1]) + lengths[2].max(lengths[3]),
    };
    let mut left = width(gap, start) - least;
    if left <= 0.0 {
        return if speed > 0.0 { 0.0 } else { 1.0 };
    }
    let keep = 0.2 * left;
    if speed <= left - keep {
        return 1.0;
    }
    let mut part = 0.0;
    for _ in 0..500 {
        let next: f64 = part + 0.9 * (left - keep).max(0.05 * keep) / speed;
        let at = next.min(1.0);
        let x = [0, 1, 2, 3].map(|k| start[k] + moves[k] * at);
        left = width(gap, &x) - least;
        if left < keep {
            return part;
        }
        part = at;
        if part >= 1.0 {
            return 1.0;
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::random::Random;

    #[test]
    fn a_gap_stays_open_all_the_way() {
        let mut random = Random::new(6);
        for k in 0..2000 {
            let gap = if k % 2 == 0 { Gap::PointTriangle } else { Gap::EdgeEdge };
            let x = [0; 4].map(|_| random.point());
            let moves = [0; 4].map(|_| random.point() * 2.0);
            let part = free_part(gap, &x, &moves, 0.0);
            for step in 0..=50 {
                let t = part * f64::from(step) / 50.0;
                let moved = [0, 1, 2, 3].map(|k| x[k] + moves[k] * t);
                assert!(width(gap, &moved) > 0.1 * width(gap, &x), "{k} {t}");
            }
        }
    }

    #[test]
    fn a_falling_point_stops_before_the_triangle() {
        let x = [Point::z(), Point::zeros(), Point::x(), Point::y()];
        let falls = [Point::z() * -2.0, Point::zeros(), Point::zeros(), Point::zeros()];
        let part = free_part(Gap::PointTriangle, &x, &falls, 0.0);
        assert!(part > 0.35 && part <= 0.4, "{part}");
        let rises = [Point::z() * 2.0, Point::zeros(), Point::zeros(), Point::zeros()];
        assert_eq!(free_part(Gap::PointTriangle, &x, &rises, 0.0), 1.0);
    }
}
