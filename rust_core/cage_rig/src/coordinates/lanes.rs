//! Mean value weights of several points at once, one point a lane.
//!
//! The vector form without unit vectors: with p the arms to the corners, N = p × p of two of them and
//! H = θ/(2 sin θ) N / |p||p|, shared by the two faces of an edge, a face adds (ΣH · N_k) / (p₀ · n) to
//! corner k, n its area vector. θ/sin θ is a polynomial in cos θ. Rounding is some ε · R then, with R =
//! longest side² / |p₀ · n|. Where that is much against the sum of all weights (faces seen edge-on,
//! edges near the point, and all that is touched), `Patch::sight` takes over, face by face.

use super::mean_value::{Correction, Surface};
use super::patch::{Face, Patch, Sight};
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use crate::simd::{Double, Kernel, Lanes};

/// Most lanes that a vector has.
const MOST: usize = 8;
/// R beyond this many per size is looked at again when the sum is known.
const DOUBTFUL: f64 = 200.0;
/// R beyond this many times the sum of all weights is too much: rows are exact to 1e-12 below it, mostly to 1e-14.
const INEXACT: f64 = 500.0;
/// Weights of an R beyond this many per size say nothing.
const HOPELESS: f64 = 1e9;
/// Edges that look longer than by this cosine are left out.
const LONGEST: f64 = -0.995;

/// θ/(2 sin θ) for cos θ from 0 to 1, in powers of 1 − 2 cos θ: Chebyshev interpolation, to 2e-16.
const HALF_ANGLE_OVER_SINE: [f64; 20] = [
    0.6045997880780725,
    0.1318000706406421,
    0.03486659602604614,
    0.009918573461268648,
    0.002930814486730399,
    0.0008864642299229457,
    0.0002723870036445583,
    8.46549799553282e-05,
    2.653678934874219e-05,
    8.374537541322987e-06,
    2.6573760557961227e-06,
    8.46931102556976e-07,
    2.7040077712692603e-07,
    8.671394061622302e-08,
    2.862182868049458e-08,
    9.278750926468914e-09,
    2.3849157087439417e-09,
    7.47989305897821e-10,
    5.313043816025362e-10,
    1.7761041103691291e-10,
];

/// Rows of `points`, one after the other: `rows` is `#points by #V`. With a `correction` they reproduce their points.
pub(super) struct Weigh<'a> {
    pub(super) surface: &'a Surface<'a>,
    pub(super) points: &'a [Point],
    pub(super) correction: Option<&'a Correction>,
    pub(super) rows: &'a mut [f64],
    pub(super) part: &'a Part<'a>,
    /// Whether it was cancelled.
    pub(super) done: &'a mut Result<(), Cancelled>,
}

type Three<S> = [Double<S>; 3];

/// What the points of one vector see of a patch.
struct Room<S: Lanes> {
    /// p and 1/|p| of each vertex.
    arms: Vec<(Three<S>, Double<S>)>,
    /// N and H of each edge.
    sides: Vec<[Three<S>; 2]>,
    weights: Vec<Double<S>>,
    doubtful: Vec<Doubtful<S>>,
}

/// A face that some lanes have not added up yet, its R in each lane (0: added up) and what it would add.
struct Doubtful<S: Lanes> {
    patch: u32,
    face: u32,
    rounding: Double<S>,
    weights: Three<S>,
}

impl Kernel for Weigh<'_> {
    #[inline(always)]
    fn run<S: Lanes>(self, s: S) {
        let Self { surface, points, correction, rows, part, done } = self;
        let width = surface.vertices.len();
        let mut room =
            Room::<S> { arms: Vec::new(), sides: Vec::new(), weights: Vec::new(), doubtful: Vec::new() };
        let mut sums = vec![s.splat_f64s(0.0); width];
        let lanes = S::F64_LANES;
        for (points, rows) in points.chunks(lanes).zip(rows.chunks_mut(lanes * width)) {
            sums.fill(s.splat_f64s(0.0));
            let mut touched = [false; MOST];
            let at = gather(s, points);
            room.doubtful.clear();
            for (index, patch) in surface.patches.iter().enumerate() {
                *done = part.check();
                if done.is_err() {
                    return;
                }
                see(s, surface, index, at, &mut touched, &mut room);
                for (&v, weight) in patch.vertices.iter().zip(&room.weights) {
                    sums[v as usize] = s.add_f64s(sums[v as usize], *weight);
                }
            }
            look_again(s, surface, points, &mut touched, &room.doubtful, &mut sums);
            normalise(s, &mut sums);
            if let Some(correction) = correction {
                correct(s, surface.vertices, correction, at, &mut sums);
            }
            for (v, sum) in sums.iter().enumerate() {
                let numbers = spread(s, *sum);
                for (lane, row) in rows.chunks_exact_mut(width).enumerate() {
                    row[v] = numbers[lane];
                }
            }
            for (lane, row) in rows.chunks_exact_mut(width).enumerate().filter(|(lane, _)| touched[*lane]) {
                surface.place(&points[lane], row);
                if let Some(correction) = correction {
                    correction.apply(surface.vertices, &points[lane], row);
                }
            }
        }
    }
}

/// The points, the last one in all lanes that are left.
#[inline(always)]
fn gather<S: Lanes>(s: S, points: &[Point]) -> Three<S> {
    let mut numbers = [[0.0; MOST]; 3];
    for lane in 0..S::F64_LANES {
        let point = points[lane.min(points.len() - 1)];
        (0..3).for_each(|d| numbers[d][lane] = point[d]);
    }
    [load(s, &numbers[0]), load(s, &numbers[1]), load(s, &numbers[2])]
}

#[inline(always)]
fn load<S: Lanes>(_: S, numbers: &[f64; MOST]) -> Double<S> {
    S::as_simd_f64s(&numbers[..S::F64_LANES]).0[0]
}

#[inline(always)]
fn spread<S: Lanes>(_: S, vector: Double<S>) -> [f64; MOST] {
    let mut numbers = [0.0; MOST];
    S::as_mut_simd_f64s(&mut numbers[..S::F64_LANES]).0[0] = vector;
    numbers
}

#[inline(always)]
fn splat<S: Lanes>(s: S, p: &Point) -> Three<S> {
    [s.splat_f64s(p.x), s.splat_f64s(p.y), s.splat_f64s(p.z)]
}

#[inline(always)]
fn dot<S: Lanes>(s: S, a: Three<S>, b: Three<S>) -> Double<S> {
    s.fused_double(a[2], b[2], s.fused_double(a[1], b[1], s.mul_f64s(a[0], b[0])))
}

#[inline(always)]
fn cross<S: Lanes>(s: S, a: Three<S>, b: Three<S>) -> Three<S> {
    [minor(s, a, b, 1, 2), minor(s, a, b, 2, 0), minor(s, a, b, 0, 1)]
}

#[inline(always)]
fn minor<S: Lanes>(s: S, a: Three<S>, b: Three<S>, i: usize, k: usize) -> Double<S> {
    s.sub_f64s(s.mul_f64s(a[i], b[k]), s.mul_f64s(a[k], b[i]))
}

#[inline(always)]
fn scaled<S: Lanes>(s: S, factor: Double<S>, a: Three<S>) -> Three<S> {
    [s.mul_f64s(factor, a[0]), s.mul_f64s(factor, a[1]), s.mul_f64s(factor, a[2])]
}

/// factor · a + b.
#[inline(always)]
fn scaled_to<S: Lanes>(s: S, factor: Double<S>, a: Three<S>, b: Three<S>) -> Three<S> {
    [
        s.fused_double(factor, a[0], b[0]),
        s.fused_double(factor, a[1], b[1]),
        s.fused_double(factor, a[2], b[2]),
    ]
}

/// θ/(2 sin θ) from cos θ ≥ 0.
#[inline(always)]
fn half_angle_over_sine<S: Lanes>(s: S, cosine: Double<S>) -> Double<S> {
    let x = s.fused_double(s.splat_f64s(-2.0), cosine, s.splat_f64s(1.0));
    let xx = s.mul_f64s(x, x);
    let xxxx = s.mul_f64s(xx, xx);
    let mut sum = s.splat_f64s(0.0);
    for c in HALF_ANGLE_OVER_SINE.rchunks_exact(4) {
        let low = s.fused_double(s.splat_f64s(c[1]), x, s.splat_f64s(c[0]));
        let high = s.fused_double(s.splat_f64s(c[3]), x, s.splat_f64s(c[2]));
        sum = s.fused_double(sum, xxxx, s.fused_double(high, xx, low));
    }
    sum
}

/// Adds up what the points `at` see of a patch, but for what is doubtful.
#[inline(always)]
fn see<S: Lanes>(
    s: S,
    surface: &Surface,
    index: usize,
    at: Three<S>,
    touched: &mut [bool; MOST],
    room: &mut Room<S>,
) {
    let patch = &surface.patches[index];
    see_vertices(s, surface, patch, at, touched, room);
    see_edges(s, patch, room);
    room.weights.clear();
    let (zero, never, most) =
        (s.splat_f64s(0.0), s.splat_f64s(f64::INFINITY), s.splat_f64s(DOUBTFUL / surface.size));
    room.weights.resize(patch.vertices.len(), zero);
    for (number, face) in patch.faces.iter().enumerate() {
        let (mut weights, rounding) = see_face(s, face, room);
        let exact = s.less_than_or_equal_f64s(rounding, most);
        // What is no number has lost everything.
        let lost = s.select_f64s(s.equal_f64s(rounding, rounding), rounding, never);
        let doubt = s.select_f64s(exact, zero, lost);
        if s.first_true_m64s(s.less_than_f64s(zero, doubt)) < S::F64_LANES {
            room.doubtful.push(Doubtful {
                patch: index as u32,
                face: number as u32,
                rounding: doubt,
                weights,
            });
            weights = weights.map(|weight| s.select_f64s(exact, weight, zero));
        }
        for (corner, weight) in face.corners.iter().zip(weights) {
            let sum = &mut room.weights[*corner as usize];
            *sum = s.add_f64s(*sum, weight);
        }
    }
}

/// The arms to a patch's vertices, and which points touch one of them.
#[inline(always)]
fn see_vertices<S: Lanes>(
    s: S,
    surface: &Surface,
    patch: &Patch,
    at: Three<S>,
    touched: &mut [bool; MOST],
    room: &mut Room<S>,
) {
    let one = s.splat_f64s(1.0);
    let mut nearest = s.splat_f64s(f64::INFINITY);
    room.arms.clear();
    for &v in &patch.vertices {
        let place = splat(s, &surface.vertices[v as usize]);
        let arm = [s.sub_f64s(place[0], at[0]), s.sub_f64s(place[1], at[1]), s.sub_f64s(place[2], at[2])];
        let squared = dot(s, arm, arm);
        nearest = s.min_f64s(nearest, squared);
        room.arms.push((arm, s.div_f64s(one, s.sqrt_f64s(squared))));
    }
    let nearest = spread(s, nearest);
    for lane in 0..S::F64_LANES {
        touched[lane] |= nearest[lane] <= surface.touch * surface.touch;
    }
}

/// N and H of a patch's edges; H is no number where the edge looks longer than all that is exact.
#[inline(always)]
fn see_edges<S: Lanes>(s: S, patch: &Patch, room: &mut Room<S>) {
    let zero = s.splat_f64s(0.0);
    room.sides.clear();
    for edge in &patch.edges {
        let [(from, near), (to, far)] = edge.ends.map(|v| room.arms[v as usize]);
        let scale = s.mul_f64s(near, far);
        let cosine = s.mul_f64s(dot(s, from, to), scale);
        let normal = cross(s, from, splat(s, &edge.step));
        let mut ratio = half_angle_over_sine(s, s.max_f64s(cosine, s.neg_f64s(cosine)));
        let obtuse = s.less_than_f64s(cosine, zero);
        if s.first_true_m64s(obtuse) < S::F64_LANES {
            // θ/sin θ = π/sin θ − (π − θ)/sin θ.
            let sine = s.mul_f64s(s.sqrt_f64s(dot(s, normal, normal)), scale);
            let mended = s.sub_f64s(s.div_f64s(s.splat_f64s(std::f64::consts::FRAC_PI_2), sine), ratio);
            ratio = s.select_f64s(obtuse, mended, ratio);
            let long = s.less_than_f64s(cosine, s.splat_f64s(LONGEST));
            ratio = s.select_f64s(long, s.splat_f64s(f64::NAN), ratio);
        }
        room.sides.push([normal, scaled(s, s.mul_f64s(ratio, scale), normal)]);
    }
}

/// What a face adds to its corners, and its R (no number where H is none).
#[inline(always)]
fn see_face<S: Lanes>(s: S, face: &Face, room: &Room<S>) -> (Three<S>, Double<S>) {
    let [[n0, h0], [n1, h1], [n2, h2]] = face.edges.map(|e| room.sides[e as usize]);
    let signs = face.signs.map(|sign| s.splat_f64s(sign));
    let mean = scaled(s, signs[0], h0);
    let mean = scaled_to(s, signs[1], h1, mean);
    let mean = scaled_to(s, signs[2], h2, mean);
    let volume = dot(s, splat(s, &face.normal), room.arms[face.corners[0] as usize].0);
    let inverse = s.div_f64s(s.splat_f64s(1.0), volume);
    let size = s.max_f64s(inverse, s.neg_f64s(inverse));
    // Nothing times a mean that is no number is none either.
    let nothing = s.mul_f64s(s.splat_f64s(0.0), mean[0]);
    let weights = [
        s.mul_f64s(dot(s, mean, n0), s.mul_f64s(signs[0], inverse)),
        s.mul_f64s(dot(s, mean, n1), s.mul_f64s(signs[1], inverse)),
        s.mul_f64s(dot(s, mean, n2), s.mul_f64s(signs[2], inverse)),
    ];
    (weights, s.fused_double(s.splat_f64s(face.long), size, nothing))
}

/// Adds what was doubtful, as it is or seen more closely; finds the points that lie on the surface.
#[inline(always)]
fn look_again<S: Lanes>(
    s: S,
    surface: &Surface,
    points: &[Point],
    touched: &mut [bool; MOST],
    doubtful: &[Doubtful<S>],
    sums: &mut [Double<S>],
) {
    let (zero, hopeless) = (s.splat_f64s(0.0), s.splat_f64s(HOPELESS / surface.size));
    let mut total = zero;
    for sum in sums.iter() {
        total = s.add_f64s(total, *sum);
    }
    for Doubtful { rounding, weights: [a, b, c], .. } in doubtful {
        let all = s.add_f64s(s.add_f64s(*a, *b), *c);
        total = s.add_f64s(total, s.select_f64s(between(s, *rounding, hopeless), all, zero));
    }
    let inexact = s.mul_f64s(s.splat_f64s(INEXACT), s.max_f64s(total, s.neg_f64s(total)));
    let limit = s.min_f64s(hopeless, inexact);
    for Doubtful { patch, face, rounding, weights } in doubtful {
        let patch = &surface.patches[*patch as usize];
        let face = &patch.faces[*face as usize];
        let exact = between(s, *rounding, limit);
        let mut found = weights.map(|weight| s.select_f64s(exact, weight, zero));
        let left = s.select_f64s(exact, zero, *rounding);
        if s.first_true_m64s(s.less_than_f64s(zero, left)) < S::F64_LANES {
            let (left, mut closer) = (spread(s, left), found.map(|weight| spread(s, weight)));
            for (lane, point) in points.iter().enumerate() {
                if left[lane] > 0.0 && !touched[lane] {
                    match patch.sight(face, surface.vertices, point, surface.touch) {
                        Sight::Weights(weights) => (0..3).for_each(|k| closer[k][lane] = weights[k]),
                        Sight::Nothing => {}
                        Sight::Touched => touched[lane] = true,
                    }
                }
            }
            found = closer.map(|weight| load(s, &weight));
        }
        for (corner, weight) in face.corners.iter().zip(found) {
            let sum = &mut sums[patch.vertices[*corner as usize] as usize];
            *sum = s.add_f64s(*sum, weight);
        }
    }
    let inexact = spread(s, inexact);
    // Far outside the sum is so small that every face is doubtful.
    for (lane, point) in points.iter().enumerate() {
        if !touched[lane] && inexact[lane] < DOUBTFUL / surface.size {
            let (row, on_it) = surface.seen_closely(point);
            touched[lane] = on_it;
            for (sum, weight) in sums.iter_mut().zip(&row) {
                let mut numbers = spread(s, *sum);
                numbers[lane] = *weight;
                *sum = load(s, &numbers);
            }
        }
    }
}

/// Where 0 < `a` ≤ `most`.
#[inline(always)]
fn between<S: Lanes>(s: S, a: Double<S>, most: Double<S>) -> S::m64s {
    s.and_m64s(s.less_than_f64s(s.splat_f64s(0.0), a), s.less_than_or_equal_f64s(a, most))
}

/// Sums of 1; all 0 where the mesh has no weight at all.
#[inline(always)]
fn normalise<S: Lanes>(s: S, weights: &mut [Double<S>]) {
    let zero = s.splat_f64s(0.0);
    let mut total = zero;
    for weight in weights.iter() {
        total = s.add_f64s(total, *weight);
    }
    let none = s.equal_f64s(total, zero);
    let scale = s.select_f64s(none, zero, s.div_f64s(s.splat_f64s(1.0), total));
    for weight in weights {
        *weight = s.mul_f64s(*weight, scale);
    }
}

/// The smallest change that makes rows reproduce their points.
#[inline(always)]
fn correct<S: Lanes>(
    s: S,
    vertices: &[Point],
    correction: &Correction,
    at: Three<S>,
    rows: &mut [Double<S>],
) {
    let Some(inverse) = &correction.spread_inverse else { return };
    let mut miss = [s.splat_f64s(0.0); 3];
    for (weight, vertex) in rows.iter().zip(vertices) {
        let place = splat(s, vertex);
        let arm = [s.sub_f64s(place[0], at[0]), s.sub_f64s(place[1], at[1]), s.sub_f64s(place[2], at[2])];
        miss = scaled_to(s, *weight, arm, miss);
    }
    let row = |d: usize| splat(s, &Point::new(-inverse[(d, 0)], -inverse[(d, 1)], -inverse[(d, 2)]));
    let slope = [dot(s, row(0), miss), dot(s, row(1), miss), dot(s, row(2), miss)];
    for (weight, vertex) in rows.iter_mut().zip(vertices) {
        *weight = s.add_f64s(*weight, dot(s, slope, splat(s, &(vertex - correction.middle))));
    }
}
