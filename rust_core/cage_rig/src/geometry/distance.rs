//! The distance of a point to triangles.

use crate::points::Point;

/// Squared distance of `point` to the triangle `a` `b` `c`, by the region of the plane that the
/// point lies over (Ericson, *Real-Time Collision Detection*, §5.1.5).
pub fn squared_distance(point: &Point, [a, b, c]: [&Point; 3]) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.norm_squared();
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.norm_squared();
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.norm_squared();
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let nearest = if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        a + ab * (d1 / (d1 - d3))
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        a + ac * (d2 / (d2 - d6))
    } else if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    } else {
        a + (ab * vb + ac * vc) / (va + vb + vc)
    };
    (point - nearest).norm_squared()
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
}
