//! Nearest points of triangles and segments.

use crate::points::Point;

/// Weights of the corners `a` `b` `c` for the point of their triangle nearest to `point`, by the
/// region of the plane that the point lies over (Ericson, *Real-Time Collision Detection*, §5.1.5).
pub fn nearest_on_triangle(point: &Point, [a, b, c]: [&Point; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        [1.0 - t, t, 0.0]
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        [1.0 - t, 0.0, t]
    } else if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        [0.0, 1.0 - t, t]
    } else {
        let sum = va + vb + vc;
        [va / sum, vb / sum, vc / sum]
    }
}

/// Squared distance of `point` to the triangle `a` `b` `c`.
pub fn squared_distance(point: &Point, [a, b, c]: [&Point; 3]) -> f64 {
    let [u, v, w] = nearest_on_triangle(point, [a, b, c]);
    (point - (a * u + b * v + c * w)).norm_squared()
}

/// How far along the segments `a` `b` and `c` `d` their nearest points lie, each from 0 to 1
/// (Ericson §5.1.9).
pub fn nearest_on_segments([a, b]: [&Point; 2], [c, d]: [&Point; 2]) -> (f64, f64) {
    let (first, second, between) = (b - a, d - c, a - c);
    let (aa, ee, f) = (first.norm_squared(), second.norm_squared(), second.dot(&between));
    let unit = |x: f64| x.clamp(0.0, 1.0);
    if aa <= f64::MIN_POSITIVE {
        return (0.0, if ee <= f64::MIN_POSITIVE { 0.0 } else { unit(f / ee) });
    }
    let along = first.dot(&between);
    if ee <= f64::MIN_POSITIVE {
        return (unit(-along / aa), 0.0);
    }
    let both = first.dot(&second);
    let determinant = aa * ee - both * both;
    let s = if determinant > 1e-14 * aa * ee { unit((both * f - along * ee) / determinant) } else { 0.0 };
    let t = (both * s + f) / ee;
    if t < 0.0 {
        (unit(-along / aa), 0.0)
    } else if t > 1.0 {
        (unit((both - along) / aa), 1.0)
    } else {
        (s, t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::random::Random;

    #[test]
    fn no_point_of_the_triangle_is_nearer_and_one_is_as_near() {
        let mut random = Random::new(11);
        for _ in 0..300 {
            let [a, b, c, point] = [0; 4].map(|_| random.point());
            let found = squared_distance(&point, [&a, &b, &c]).sqrt();
            let steps = 60;
            let mut nearest = f64::INFINITY;
            for i in 0..=steps {
                for k in 0..=steps - i {
                    let (u, v) = (f64::from(i) / f64::from(steps), f64::from(k) / f64::from(steps));
                    nearest = nearest.min((a + (b - a) * u + (c - a) * v - point).norm());
                }
            }
            let spacing = (b - a).norm().max((c - a).norm()) / f64::from(steps);
            assert!(found <= nearest + 1e-12 && nearest <= found + spacing, "{found} {nearest}");
        }
    }

    #[test]
    fn no_two_points_of_segments_are_nearer() {
        let mut random = Random::new(12);
        for _ in 0..300 {
            let [a, b, c, d] = [0; 4].map(|_| random.point());
            let (s, t) = nearest_on_segments([&a, &b], [&c, &d]);
            let found = (a + (b - a) * s - c - (d - c) * t).norm();
            for i in 0..=40 {
                for k in 0..=40 {
                    let (s, t) = (f64::from(i) / 40.0, f64::from(k) / 40.0);
                    assert!((a + (b - a) * s - c - (d - c) * t).norm() >= found - 1e-12);
                }
            }
        }
    }
}
