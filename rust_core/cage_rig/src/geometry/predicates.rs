//! On which side does a point lie? Exact answers for the coordinates as they are stored.
//!
//! Adaptive-precision determinants of Shewchuk, 1997 (crate `robust`): a floating-point filter
//! first, expansions only where it can't tell.

use crate::points::Point;
use robust::{Coord, Coord3D};

/// Which way `d` lies of the plane through `a` `b` `c`: 1 where the triangle turns clockwise seen
/// from `d` (behind an outward face), −1 in front of it, 0 on the plane.
pub fn side(a: &Point, b: &Point, c: &Point, d: &Point) -> i8 {
    let coord = |p: &Point| Coord3D { x: p.x, y: p.y, z: p.z };
    sign(robust::orient3d(coord(a), coord(b), coord(c), coord(d)))
}

/// Which way `a` `b` `c` turn in the plane: 1 left, −1 right, 0 not at all.
pub fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> i8 {
    let coord = |p: [f64; 2]| Coord { x: p[0], y: p[1] };
    sign(robust::orient2d(coord(a), coord(b), coord(c)))
}

fn sign(value: f64) -> i8 {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_told_where_rounding_cannot() {
        let [a, b] = [[0.0, 0.0], [12.0, 12.0]];
        let step = 0.5_f64.powi(53);
        for k in 0..64 {
            let c = [0.5 + step * f64::from(k), 0.5];
            assert_eq!(turn(a, b, c), -i8::from(k > 0), "{k}");
        }
    }

    #[test]
    fn a_point_behind_an_outward_face_is_positive() {
        let [a, b, c] = [Point::zeros(), Point::x(), Point::y()];
        assert_eq!(side(&a, &b, &c, &Point::new(0.2, 0.2, -1.0)), 1);
        assert_eq!(side(&a, &b, &c, &Point::new(0.2, 0.2, 1.0)), -1);
        assert_eq!(side(&a, &b, &c, &Point::new(5.0, -3.0, 0.0)), 0);
    }
}
