//! Oracles: each method straight from its equation, in double precision.

use crate::points::{Matrix3, Point, Transform};
use crate::rows::Rows;

/// M′ from T, Ω (`#M by #J`, rows that sum to 1 or 0), M and p.
pub(crate) type Oracle = fn(&[Transform], &Rows, &[Point], &[Point]) -> Vec<Point>;

/// The oracle of each method in `METHODS`.
pub(crate) const ORACLES: &[(&str, Oracle)] = &[
    ("lbs", |transforms, weights, rest, _| lbs(transforms, weights, rest)),
    ("dqs", |transforms, weights, rest, _| dqs(transforms, weights, rest)),
    ("cor", cor),
];

/// Ω as the oracles want it: dense, every row sums to 1 or 0.
pub(crate) fn normalised(weights: &Rows) -> Rows {
    let mut dense = weights.clone();
    for i in 0..dense.len() {
        let sum: f64 = dense.row(i).iter().sum();
        dense.row_mut(i).iter_mut().filter(|_| sum > 0.0).for_each(|w| *w /= sum);
    }
    dense
}

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

/// [KCZO08], Eq. (4) of [CTL*20], with the scale of T_j = R_j S_j applied to v first and its
/// displacement counted as translation: τ_j(v) = T_j(v) − R_j v.
pub(crate) fn dqs(transforms: &[Transform], weights: &Rows, rest: &[Point]) -> Vec<Point> {
    let turns: Vec<Matrix3> = transforms.iter().map(|t| polar(&t.linear)).collect();
    let real: Vec<Quaternion> = turns.iter().map(quaternion).collect();
    let mut posed = Vec::new();
    for (i, v) in rest.iter().enumerate() {
        let signs = signs(weights.row(i), &real);
        let (mut q, mut d) = ([0.0; 4], [0.0; 4]);
        for (j, t) in transforms.iter().enumerate() {
            let step = t.linear * v + t.translation - turns[j] * v;
            let dual = times([0.0, step.x / 2.0, step.y / 2.0, step.z / 2.0], real[j]);
            for k in 0..4 {
                q[k] += weights.row(i)[j] * signs[j] * real[j][k];
                d[k] += weights.row(i)[j] * signs[j] * dual[k];
            }
        }
        let size: f64 = q.iter().map(|x| x * x).sum();
        // q v q* + 2 d q*, over |q|².
        let conjugate = [q[0], -q[1], -q[2], -q[3]];
        let turned = times(times(q, [0.0, v.x, v.y, v.z]), conjugate);
        let moved = times(d, conjugate);
        posed.push(if size == 0.0 {
            *v
        } else {
            Point::from_fn(|k, _| (turned[k + 1] + 2.0 * moved[k + 1]) / size)
        });
    }
    posed
}

/// Eq. (5–6): R(i) turns about p_i, which bones move linearly; before it the scales of T_j = R_j S_j
/// blend linearly about p_i.
pub(crate) fn cor(transforms: &[Transform], weights: &Rows, rest: &[Point], centers: &[Point]) -> Vec<Point> {
    let turns: Vec<Matrix3> = transforms.iter().map(|t| polar(&t.linear)).collect();
    let real: Vec<Quaternion> = turns.iter().map(quaternion).collect();
    let mut posed = Vec::new();
    for (i, (v, p)) in rest.iter().zip(centers).enumerate() {
        let signs = signs(weights.row(i), &real);
        let (mut q, mut stretch, mut carried) = ([0.0; 4], Matrix3::zeros(), Point::zeros());
        for (j, t) in transforms.iter().enumerate() {
            let weight = weights.row(i)[j];
            (0..4).for_each(|k| q[k] += weight * signs[j] * real[j][k]);
            stretch += weight * turns[j].transpose() * t.linear;
            carried += weight * (t.linear * p + t.translation);
        }
        let size: f64 = q.iter().map(|x| x * x).sum();
        let d = stretch * (v - p);
        let turned = times(times(q, [0.0, d.x, d.y, d.z]), [q[0], -q[1], -q[2], -q[3]]);
        posed.push(if size == 0.0 { *v } else { carried + Point::from_fn(|k, _| turned[k + 1] / size) });
    }
    posed
}

/// [LH16]: p_i = Σ_x s(ω_i, ω_x) a_x x / Σ_x s(ω_i, ω_x) a_x over triangles x with area a_x, mean
/// weights ω_x and mean position x; with Σ s a_x |x − p_i|², the spread of what moves alike.
pub(crate) fn center(
    skin: &[Point],
    triangles: &[[u32; 3]],
    weights: &Rows,
    vertex: usize,
    sigma: f64,
) -> Option<(Point, f64)> {
    let own = weights.row(vertex);
    let (mut total, mut first, mut second) = (0.0, Point::zeros(), 0.0);
    for corners in triangles {
        let [a, b, c] = corners.map(|v| skin[v as usize]);
        let area = (b - a).cross(&(c - a)).norm() / 2.0;
        let middle = (a + b + c) / 3.0;
        let mean: Vec<f64> = (0..own.len())
            .map(|j| corners.iter().map(|&v| weights.row(v as usize)[j]).sum::<f64>() / 3.0)
            .collect();
        let joints: Vec<usize> = (0..own.len()).filter(|&j| own[j] * mean[j] > 0.0).collect();
        for (n, &j) in joints.iter().enumerate() {
            for &k in &joints[n + 1..] {
                let apart = (own[j] * mean[k] - own[k] * mean[j]) / sigma;
                let share = own[j] * own[k] * mean[j] * mean[k] * (-apart * apart).exp() * area;
                total += share;
                first += share * middle;
                second += share * middle.norm_squared();
            }
        }
    }
    let p = first / total;
    (total > 0.0).then(|| (p, (second / total - p.norm_squared()).max(0.0).sqrt()))
}

/// w, x, y, z.
type Quaternion = [f64; 4];

fn times(a: Quaternion, b: Quaternion) -> Quaternion {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The sign of each bone's quaternion that is nearer to that of the largest weight.
fn signs(weights: &[f64], real: &[Quaternion]) -> Vec<f64> {
    let largest = weights.iter().fold(0.0, |most: f64, w| most.max(*w));
    let pivot = real[weights.iter().position(|w| *w == largest).unwrap_or(0)];
    real.iter().map(|q| (0..4).map(|k| q[k] * pivot[k]).sum::<f64>()).map(f64::signum).collect()
}

/// The rotation of the polar decomposition by Newton's iteration X ← (X + X⁻ᵀ) / 2, of −L where L
/// mirrors.
fn polar(linear: &Matrix3) -> Matrix3 {
    let mut x = if linear.determinant() < 0.0 { -linear } else { *linear };
    for _ in 0..100 {
        x = (x + x.transpose().try_inverse().expect("an invertible pose")) / 2.0;
    }
    x
}

/// The quaternion of a rotation from the largest of its four squares [Shepperd 1978].
fn quaternion(m: &Matrix3) -> Quaternion {
    let trace = m.trace();
    let squares: [f64; 4] = std::array::from_fn(|k| match k {
        0 => 1.0 + trace,
        k => 1.0 - trace + 2.0 * m[(k - 1, k - 1)],
    });
    let (a, b, c) = (m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]);
    let (d, e, f) = (m[(1, 0)] + m[(0, 1)], m[(2, 0)] + m[(0, 2)], m[(2, 1)] + m[(1, 2)]);
    let largest = (0..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let row =
        [[squares[0], a, b, c], [a, squares[1], d, e], [b, d, squares[2], f], [c, e, f, squares[3]]][largest];
    row.map(|x| x / (2.0 * squares[largest].sqrt()))
}
