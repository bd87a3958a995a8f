//! The guiding field around one control node: harmonic, 0 on a tube around the skeleton, 1 on the
//! skin [CLM*19 §5].
//!
//! The paper solves on tetrahedra. Here a window grid of ±4 radii is used, the skin found by axis
//! rays and cutting the grid's edges where it crosses them, so that gaps thinner than a cell still
//! separate. A tube of 0.2 radii, not the bare curve: a curve has no capacity, and its field would
//! depend on the grid. Conjugate gradients with Jacobi's preconditioner; `N⁴` or so a window.

use super::skeleton::CurveSkeleton;
use super::skin::Skin;
use crate::geometry::bvh::Crossing;
use crate::points::Point;

/// Half width of a window in radii.
const HALF: f64 = 4.0;
/// Radius of the tube of value 0, in radii of the inscribed ball.
const TUBE: f64 = 0.2;

/// Sampled values on a cubic grid.
pub(crate) struct Field {
    size: usize,
    origin: Point,
    pub(crate) spacing: f64,
    values: Vec<f32>,
}

/// One grid with the skin's crossings on its edges.
struct Window {
    size: usize,
    origin: Point,
    spacing: f64,
    inside: Vec<bool>,
    /// For each axis and cell: where along the edge to the next cell the skin is crossed first and
    /// last, 0 to 1; negative when it is not.
    cuts: [Vec<[f32; 2]>; 3],
}

impl Field {
    /// The field around `center`, whose inscribed ball has `radius`; `size` cells a side.
    pub(crate) fn new(
        skin: &Skin,
        skeleton: &CurveSkeleton,
        center: &Point,
        radius: f64,
        size: usize,
    ) -> Self {
        let window = Window::new(skin, center, radius, size);
        let values = window.solve(skeleton, radius);
        Self { size, origin: window.origin, spacing: window.spacing, values }
    }

    /// The gradient at `p`, up to scale; `None` outside the window.
    pub(crate) fn gradient(&self, p: &Point) -> Option<Point> {
        let q = (p - self.origin) / self.spacing;
        let last = (self.size - 2) as f64;
        if !(0..3).all(|k| q[k] >= 0.0 && q[k] <= last + 0.999) {
            return None;
        }
        let cell = [0, 1, 2].map(|k| q[k].floor().min(last) as usize);
        let t = [0, 1, 2].map(|k| q[k] - cell[k] as f64);
        let at = |i: usize, j: usize, k: usize| {
            f64::from(self.values[((cell[0] + i) * self.size + cell[1] + j) * self.size + cell[2] + k])
        };
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let mut gradient = Point::zeros();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let value = |step: usize, i: usize, j: usize| {
                let mut offset = [0; 3];
                offset[axis] = step;
                offset[u] = i;
                offset[v] = j;
                at(offset[0], offset[1], offset[2])
            };
            let slope = |i: usize, j: usize| value(1, i, j) - value(0, i, j);
            gradient[axis] =
                mix(mix(slope(0, 0), slope(1, 0), t[u]), mix(slope(0, 1), slope(1, 1), t[u]), t[v]);
        }
        Some(gradient)
    }

    #[cfg(test)]
    pub(crate) fn value(&self, p: &Point) -> f64 {
        let q =
            ((p - self.origin) / self.spacing).map(|x| x.round().clamp(0.0, (self.size - 1) as f64) as usize);
        f64::from(self.values[(q.x * self.size + q.y) * self.size + q.z])
    }
}

impl Window {
    fn new(skin: &Skin, center: &Point, radius: f64, size: usize) -> Self {
        let spacing = 2.0 * HALF * radius / (size - 1) as f64;
        let origin = center - Point::repeat(HALF * radius);
        let none = [-1.0_f32, -1.0];
        let cuts = [0; 3].map(|_| vec![none; size * size * size]);
        let mut window = Self { size, origin, spacing, inside: vec![false; size * size * size], cuts };
        let mut found = Vec::new();
        for axis in 0..3 {
            for i in 0..size {
                for j in 0..size {
                    window.scan(skin, axis, i, j, &mut found);
                }
            }
        }
        window
    }

    fn scan(&mut self, skin: &Skin, axis: usize, i: usize, j: usize, found: &mut Vec<Crossing>) {
        let stride = [self.size * self.size, self.size, 1];
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let start = i * stride[u] + j * stride[v];
        let mut p = self.origin;
        p[u] += i as f64 * self.spacing;
        p[v] += j as f64 * self.spacing;
        skin.tree.crossings(&skin.points, &p, axis, found);
        found.sort_by(|a, b| a.at.total_cmp(&b.at));
        let (mut winding, mut next) = (0, 0);
        for k in 0..self.size {
            let x = p[axis] + k as f64 * self.spacing;
            while next < found.len() && found[next].at <= x {
                winding += found[next].sign;
                next += 1;
            }
            let cell = start + k * stride[axis];
            if axis == 0 {
                self.inside[cell] = winding > 0;
            }
            // Between overlapping parts nothing is cut: only where the winding falls to nothing.
            let (mut within, mut at) = (winding, next);
            let mut cut: Option<[f32; 2]> = None;
            while at < found.len() && found[at].at <= x + self.spacing {
                let before = within > 0;
                within += found[at].sign;
                if before != (within > 0) {
                    let t = ((found[at].at - x) / self.spacing) as f32;
                    cut = Some([cut.map_or(t, |c| c[0]), t]);
                }
                at += 1;
            }
            if let Some(cut) = cut {
                self.cuts[axis][cell] = cut;
            }
        }
    }

    /// The neighbour of `cell` along `axis` up or down, with the part of the edge before the skin
    /// (1 and no neighbour's value when it is cut).
    fn step(&self, cell: usize, axis: usize, up: bool) -> Step {
        let stride = [self.size * self.size, self.size, 1][axis];
        let k = (cell / stride) % self.size;
        if (up && k + 1 == self.size) || (!up && k == 0) {
            return Step::Border;
        }
        let next = if up { cell + stride } else { cell - stride };
        let [first, last] = self.cuts[axis][if up { cell } else { next }];
        if first >= 0.0 {
            let part = if up { first } else { 1.0 - last };
            return Step::Skin(f64::from(part).clamp(0.02, 1.0));
        }
        if self.inside[next] {
            Step::To(next)
        } else {
            Step::Skin(1.0)
        }
    }

    /// Cells inside that are connected to the window's middle.
    fn connected(&self) -> Vec<bool> {
        let n = self.size;
        let mut seen = vec![false; n * n * n];
        let middle = [(n - 1) / 2, n / 2];
        let mut stack = Vec::new();
        for i in middle {
            for j in middle {
                for k in middle {
                    let cell = (i * n + j) * n + k;
                    if self.inside[cell] && !seen[cell] {
                        seen[cell] = true;
                        stack.push(cell);
                    }
                }
            }
        }
        while let Some(cell) = stack.pop() {
            for axis in 0..3 {
                for up in [true, false] {
                    if let Step::To(next) = self.step(cell, axis, up) {
                        if !seen[next] {
                            seen[next] = true;
                            stack.push(next);
                        }
                    }
                }
            }
        }
        seen
    }

    fn place(&self, cell: usize) -> Point {
        let n = self.size;
        let index = [cell / (n * n), (cell / n) % n, cell % n];
        self.origin + Point::new(index[0] as f64, index[1] as f64, index[2] as f64) * self.spacing
    }

    /// Radius of the tube at the nearest skeleton point, minus the distance to it, largest over all.
    fn tube(&self, skeleton: &CurveSkeleton, radius: f64, cells: &[usize]) -> Vec<f64> {
        let middle = self.origin + Point::repeat(0.5 * (self.size - 1) as f64 * self.spacing);
        // A control node beside the skeleton, or beyond its end, belongs to it.
        let nearest = skeleton.arcs.iter().map(|arc| (arc, arc.nearest(&middle)));
        let joint =
            nearest.min_by(|a, b| a.1 .0.total_cmp(&b.1 .0)).map_or(middle, |(arc, (_, s))| arc.at(s));
        let own = (TUBE * radius).max(1.2 * self.spacing);
        let mut pieces =
            vec![(joint, middle - joint, 1.0 / (middle - joint).norm_squared().max(1e-300), own, 0.0)];
        let least = 1.2 * self.spacing;
        for (a, b, radii) in near(skeleton, &middle, radius) {
            let [r, s] = radii.map(|r| (TUBE * r).max(least));
            pieces.push((a, b - a, 1.0 / (b - a).norm_squared().max(1e-300), r, s - r));
        }
        cells
            .iter()
            .map(|cell| {
                let p = self.place(*cell);
                let depth = |(a, u, inverse, r, grow): &(Point, Point, f64, f64, f64)| {
                    let t = ((p - a).dot(u) * inverse).clamp(0.0, 1.0);
                    r + grow * t - (a + u * t - p).norm()
                };
                pieces.iter().map(depth).fold(f64::NEG_INFINITY, f64::max)
            })
            .collect()
    }

    fn solve(&self, skeleton: &CurveSkeleton, radius: f64) -> Vec<f32> {
        let part = self.connected();
        let cells: Vec<usize> = (0..part.len()).filter(|c| part[*c]).collect();
        let tube = self.tube(skeleton, radius, &cells);
        let mut index = vec![u32::MAX; part.len()];
        let mut depth = vec![f64::NEG_INFINITY; part.len()];
        let mut unknown = Vec::new();
        for (cell, d) in cells.iter().zip(&tube) {
            depth[*cell] = *d;
            if *d < 0.0 {
                index[*cell] = unknown.len() as u32;
                unknown.push(*cell);
            }
        }
        let mut system = Laplacian::with_capacity(unknown.len());
        for &cell in &unknown {
            let (mut diagonal, mut right, mut links) = (1e-9, 1e-9, [u32::MAX; 6]);
            for axis in 0..3 {
                for up in [true, false] {
                    match self.step(cell, axis, up) {
                        Step::Border => {}
                        Step::Skin(part) => {
                            diagonal += 1.0 / part;
                            right += 1.0 / part;
                        }
                        Step::To(next) if index[next] == u32::MAX => {
                            let span = depth[next] - depth[cell];
                            diagonal += 1.0 / (-depth[cell] / span.max(1e-12)).clamp(0.1, 1.0);
                        }
                        Step::To(next) => {
                            diagonal += 1.0;
                            links[2 * axis + usize::from(up)] = index[next];
                        }
                    }
                }
            }
            system.push(diagonal, right, links);
        }
        let solution = system.solve(1e-5, 600);
        let mut values = vec![f32::NAN; part.len()];
        cells.iter().for_each(|cell| values[*cell] = 0.0);
        unknown.iter().zip(&solution).for_each(|(cell, x)| values[*cell] = *x as f32);
        self.extend(&mut values, &cells);
        values
    }

    /// Values outside the part, so that the field crosses 1 where the skin is.
    fn extend(&self, values: &mut [f32], cells: &[usize]) {
        let mut sums: Vec<(f32, f32)> = vec![(0.0, 0.0); values.len()];
        for &cell in cells {
            for axis in 0..3 {
                for up in [true, false] {
                    if let Step::Skin(part) = self.step(cell, axis, up) {
                        let stride = [self.size * self.size, self.size, 1][axis];
                        let next = if up { cell + stride } else { cell - stride };
                        let part = (part as f32).max(0.1);
                        let value = 1.0 + (1.0 - values[cell]) * (1.0 - part) / part;
                        sums[next] = (sums[next].0 + value.min(1.5), sums[next].1 + 1.0);
                    }
                }
            }
        }
        for (value, (sum, count)) in values.iter_mut().zip(sums) {
            if value.is_nan() {
                *value = if count > 0.0 { sum / count } else { 1.5 };
            }
        }
    }
}

/// Pieces of the skeleton, with the radii at their ends, that reach into the window around `center`.
pub(crate) fn near<'a>(
    skeleton: &'a CurveSkeleton,
    center: &'a Point,
    radius: f64,
) -> impl Iterator<Item = (Point, Point, [f64; 2])> + 'a {
    let reach = HALF * radius * 1.8;
    let pieces = skeleton.arcs.iter().flat_map(|arc| {
        (0..arc.path.len() - 1).map(|k| (arc.path[k], arc.path[k + 1], [arc.radii[k], arc.radii[k + 1]]))
    });
    pieces.filter(move |(a, b, _)| ((a + b) * 0.5 - center).norm() < reach + (b - a).norm())
}

/// What lies beyond a cell.
enum Step {
    /// The end of the window: nothing flows through it.
    Border,
    /// The skin, after this part of the edge.
    Skin(f64),
    /// Another cell inside.
    To(usize),
}

/// A five-or-so-point Laplacian: each row has a diagonal and links of weight −1.
struct Laplacian {
    diagonal: Vec<f64>,
    right: Vec<f64>,
    links: Vec<[u32; 6]>,
}

impl Laplacian {
    fn with_capacity(n: usize) -> Self {
        Self { diagonal: Vec::with_capacity(n), right: Vec::with_capacity(n), links: Vec::with_capacity(n) }
    }

    fn push(&mut self, diagonal: f64, right: f64, links: [u32; 6]) {
        self.diagonal.push(diagonal);
        self.right.push(right);
        self.links.push(links);
    }

    fn times(&self, x: &[f64], out: &mut [f64]) {
        for (i, value) in out.iter_mut().enumerate() {
            let near: f64 = self.links[i].iter().filter(|l| **l != u32::MAX).map(|l| x[*l as usize]).sum();
            *value = self.diagonal[i] * x[i] - near;
        }
    }

    /// Preconditioned conjugate gradients, to `tolerance` of the right-hand side.
    fn solve(&self, tolerance: f64, limit: usize) -> Vec<f64> {
        let n = self.right.len();
        let mut x = vec![0.5; n];
        let mut q = vec![0.0; n];
        self.times(&x, &mut q);
        let mut r: Vec<f64> = (0..n).map(|i| self.right[i] - q[i]).collect();
        let mut p: Vec<f64> = (0..n).map(|i| r[i] / self.diagonal[i]).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let mut rho = dot(&r, &p);
        let goal = tolerance * tolerance * rho.max(1e-300);
        for _ in 0..limit {
            if rho <= goal {
                break;
            }
            self.times(&p, &mut q);
            let step = rho / dot(&p, &q).max(1e-300);
            for i in 0..n {
                x[i] += step * p[i];
                r[i] -= step * q[i];
            }
            let next: f64 = (0..n).map(|i| r[i] * r[i] / self.diagonal[i]).sum();
            let turn = next / rho;
            rho = next;
            for i in 0..n {
                p[i] = r[i] / self.diagonal[i] + turn * p[i];
            }
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::skeleton::curve_skeleton;
    use crate::fixtures::shapes::{round_tube, square_tube};

    #[test]
    fn the_field_rises_from_the_tube_to_the_skin() {
        let rings: Vec<(f64, f64)> = (0..11).map(|i| (f64::from(i), 1.0)).collect();
        let (vertices, faces) = square_tube(&rings);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let bones = [Point::new(1.0, 0.0, 0.0), Point::new(9.0, 0.0, 0.0)];
        let skeleton = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
        let center = skin.space.enter(&Point::new(5.0, 0.0, 0.0));
        let radius = 1.0 / skin.space.size;
        let field = Field::new(&skin, &skeleton, &center, radius, 48);
        let along = |d: f64| field.value(&(center + Point::new(0.0, d * radius, 0.0)));
        assert!(along(0.0) == 0.0 && along(0.5) > 0.3 && along(0.5) < along(0.8) && along(0.8) < 1.0);
        let gradient = field.gradient(&(center + Point::new(0.0, 0.6, 0.0) * radius)).expect("in the window");
        assert!(gradient.normalize().y > 0.99);
    }

    #[test]
    fn around_the_axis_of_a_round_bar_the_field_is_the_logarithm_of_the_radius() {
        let (vertices, faces) = round_tube(10.0, 1.0, 64);
        let skin = Skin::new(&vertices, &faces).expect("closed");
        let bones = [Point::new(1.0, 0.0, 0.0), Point::new(9.0, 0.0, 0.0)];
        let skeleton = curve_skeleton(&skin, &bones, &[[0, 1]], 0.0, &[]).expect("inside");
        let center = skin.space.enter(&Point::new(5.0, 0.0, 0.0));
        let radius = 1.0 / skin.space.size;
        let field = Field::new(&skin, &skeleton, &center, radius, 96);
        let mut seen = 0;
        for j in 0..field.size {
            for k in 0..field.size {
                let cell = Point::new((field.size / 2) as f64, j as f64, k as f64);
                let p = field.origin + cell * field.spacing;
                let r = (p - center).yz().norm() / radius;
                if (1.5 * TUBE..0.97).contains(&r) {
                    let exact = (r / TUBE).ln() / (1.0 / TUBE).ln();
                    assert!(
                        (field.value(&p) - exact).abs() < 0.03,
                        "{} at {r}, not {exact}",
                        field.value(&p)
                    );
                    seen += 1;
                }
            }
        }
        assert!(seen > 300, "{seen}");
    }
}
