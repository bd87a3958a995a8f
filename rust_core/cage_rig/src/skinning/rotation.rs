//! The rotation nearest to a linear map: what a bone that scales and shears turns by.
//!
//! The polar decomposition L = R S, S symmetric. As a quaternion q, R maximises tr(RᵀL), a quadratic
//! form of q [Horn 1987]: q is the eigenvector of its largest eigenvalue, unit even where L is
//! singular. A reflection (det L < 0) is read as −L, so that S takes the mirroring in all axes.
//! Near a rotation and a scale in all directions alike, which most bones are, two steps of Newton's iteration for the
//! polar decomposition are as exact, and of a rotation that form is 4 q qᵀ − 1. Cost: some 30 ns per bone and
//! frame, or one symmetric eigenproblem of size 4.

use crate::points::Matrix3;
use nalgebra::Matrix4;

/// A unit quaternion: x, y, z, w.
pub type Quaternion = [f64; 4];

/// What LᵀL may differ from a multiple of 1 for two steps of Newton's iteration.
const NEAR: f64 = 1e-6;

/// The rotation part of `linear`; w ≥ 0. `linear` must be finite.
pub fn rotation_of(linear: &Matrix3) -> Quaternion {
    let size = linear.amax();
    if size == 0.0 {
        return [0.0, 0.0, 0.0, 1.0];
    }
    let m = linear / size;
    let m = if m.determinant() < 0.0 { -m } else { m };
    let q = match refined(&m) {
        Some(rotation) => {
            let outer = form(&rotation) + Matrix4::identity();
            outer.column(outer.diagonal().imax()).normalize()
        }
        None => {
            let eigen = form(&m).symmetric_eigen();
            eigen.eigenvectors.column(eigen.eigenvalues.imax()).normalize()
        }
    };
    let sign = if q[3] < 0.0 { -1.0 } else { 1.0 };
    std::array::from_fn(|k| sign * q[k])
}

/// The rotation nearest to `m` where that is near a multiple of it.
fn refined(m: &Matrix3) -> Option<Matrix3> {
    let m = m / m.determinant().cbrt();
    // NaN, of a singular map, is not near.
    let near = (m.transpose() * m - Matrix3::identity()).iter().all(|x| x.abs() <= NEAR);
    near.then(|| newton(&newton(&m)))
}

/// (m + m⁻ᵀ) / 2 of a matrix of determinant 1.
fn newton(m: &Matrix3) -> Matrix3 {
    let [x, y, z] = [0, 1, 2].map(|k| m.column(k));
    (m + Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)])) / 2.0
}

/// The quadratic form whose maximum over unit quaternions is at the rotation nearest to `m`.
fn form(m: &Matrix3) -> Matrix4<f64> {
    let (xx, yy, zz) = (m[(0, 0)], m[(1, 1)], m[(2, 2)]);
    let (xy, xz, yz) = (m[(0, 1)] + m[(1, 0)], m[(0, 2)] + m[(2, 0)], m[(1, 2)] + m[(2, 1)]);
    let (x, y, z) = (m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]);
    #[rustfmt::skip]
    let form = Matrix4::new(
        xx - yy - zz, xy, xz, x,
        xy, yy - xx - zz, yz, y,
        xz, yz, zz - xx - yy, z,
        x, y, z, xx + yy + zz,
    );
    form
}

/// R of a unit quaternion.
pub fn matrix_of([x, y, z, w]: Quaternion) -> Matrix3 {
    let diagonal = |a: f64, b: f64| 1.0 - 2.0 * (a * a + b * b);
    let (xy, xz, yz) = (2.0 * x * y, 2.0 * x * z, 2.0 * y * z);
    let (wx, wy, wz) = (2.0 * w * x, 2.0 * w * y, 2.0 * w * z);
    #[rustfmt::skip]
    let matrix = Matrix3::new(
        diagonal(y, z), xy - wz, xz + wy,
        xy + wz, diagonal(x, z), yz - wx,
        xz - wy, yz + wx, diagonal(x, y),
    );
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{random::Random, rotation};
    use crate::points::Point;

    /// R S of a random rotation and a random symmetric S with the given eigenvalues.
    fn product(random: &mut Random, scales: [f64; 3]) -> (Matrix3, Matrix3) {
        let turn = rotation(random.point(), random.between(-3.1, 3.1));
        let axes = rotation(random.point(), random.between(-3.1, 3.1));
        let stretch = axes * Matrix3::from_diagonal(&Point::from(scales)) * axes.transpose();
        (turn, turn * stretch)
    }

    #[test]
    fn identity_is_exact() {
        assert_eq!(rotation_of(&Matrix3::identity()), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(rotation_of(&(Matrix3::identity() * 1.7)), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(matrix_of([0.0, 0.0, 0.0, 1.0]), Matrix3::identity());
    }

    #[test]
    fn the_rotation_of_a_stretched_one_is_found() {
        let mut random = Random::new(3);
        for scales in [
            [1.0, 1.0, 1.0],
            [3.0, 3.0, 3.0],
            [1.0, 1.0 + 3e-7, 1.0 - 4e-7],
            [0.01, 1.0, 30.0],
            [2.0, 2.0, 1e-6],
            [1e-9, 2e-9, 1e-9],
        ] {
            for _ in 0..50 {
                let (turn, linear) = product(&mut random, scales);
                assert!((matrix_of(rotation_of(&linear)) - turn).norm() < 1e-13, "{scales:?}");
            }
        }
    }

    #[test]
    fn a_mirrored_map_turns_as_its_opposite() {
        let mut random = Random::new(4);
        for _ in 0..50 {
            let (turn, linear) = product(&mut random, [-1.0, -2.0, -0.5]);
            assert!((matrix_of(rotation_of(&linear)) - turn).norm() < 1e-13);
        }
        // Mirrored along x alone is turned half around x and mirrored in all axes.
        let mirror = Matrix3::from_diagonal(&Point::new(-1.0, 1.0, 1.0));
        let half_turn = Matrix3::from_diagonal(&Point::new(1.0, -1.0, -1.0));
        assert!((matrix_of(rotation_of(&mirror)) - half_turn).norm() < 1e-15);
    }

    #[test]
    fn a_singular_map_still_gives_a_unit_quaternion() {
        let flat = Matrix3::from_diagonal(&Point::new(1.0, 1.0, 0.0));
        let line = Matrix3::from_diagonal(&Point::new(0.0, 1.0, 0.0));
        let huge = Matrix3::from_element(1e308);
        for map in [flat, line, Matrix3::zeros(), rotation(Point::y(), 1.0) * flat] {
            let q = rotation_of(&map);
            assert!((q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-15);
            let stretch = matrix_of(q).transpose() * map;
            assert!((stretch - stretch.transpose()).norm() < 1e-14, "what is left is symmetric");
        }
        assert!(rotation_of(&huge).iter().all(|x| x.is_finite()));
    }
}
