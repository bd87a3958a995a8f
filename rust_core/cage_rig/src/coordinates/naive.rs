//! Oracles: each kind straight from its publication, for points away from the surface.

use crate::cage::Cage;
use crate::points::Point;

/// One row of Φ.
pub(super) type Oracle = fn(&Cage, &Point) -> Vec<f64>;

/// The oracle of each kind in `KINDS`.
pub(super) const ORACLES: &[(&str, Oracle)] = &[("mean_value", mean_value)];

/// The pseudo code of [JSW05], Figure 4, without its cases on the surface.
fn mean_value(cage: &Cage, point: &Point) -> Vec<f64> {
    let distances: Vec<f64> = cage.vertices().iter().map(|c| (c - point).norm()).collect();
    let units: Vec<Point> = cage.vertices().iter().zip(&distances).map(|(c, d)| (c - point) / *d).collect();
    let mut row = vec![0.0; units.len()];
    for triangle in cage.triangles() {
        let corners = triangle.map(|v| v as usize);
        let u = corners.map(|v| units[v]);
        let mut angles = [0.0; 3];
        for i in 0..3 {
            angles[i] = 2.0 * ((u[(i + 1) % 3] - u[(i + 2) % 3]).norm() / 2.0).asin();
        }
        let half = (angles[0] + angles[1] + angles[2]) / 2.0;
        let sign = u[0].dot(&u[1].cross(&u[2])).signum();
        let (mut c, mut s) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let others = angles[(i + 1) % 3].sin() * angles[(i + 2) % 3].sin();
            c[i] = 2.0 * half.sin() * (half - angles[i]).sin() / others - 1.0;
            s[i] = sign * (1.0f64 - c[i] * c[i]).max(0.0).sqrt();
        }
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let weight = (angles[i] - c[j] * angles[k] - c[k] * angles[j])
                / (2.0 * distances[corners[i]] * angles[j].sin() * s[k]);
            row[corners[i]] += if s.iter().any(|s| s.abs() < 1e-8) { 0.0 } else { weight };
        }
    }
    let sum: f64 = row.iter().sum();
    row.iter().map(|w| w / sum).collect()
}
