//! [`Lanes`]: what kernels may ask of vectors, with the plain way to do it.
//!
//! No vector goes through a closure (`map`, `from_fn`): a closure that is not inlined is compiled for the
//! baseline, and calls a function for every instruction.

use pulp::{Scalar128b, Simd};
#[cfg(target_arch = "aarch64")]
use {
    pulp::{cast, f32x4, i32x4},
    std::arch::aarch64::int16x4_t,
};

/// Most lanes that a vector has.
const MOST: usize = 16;

/// A vector of `L`.
pub(crate) type Vector<L> = <L as Simd>::f32s;

/// A vector of `L` in double precision.
pub(crate) type Double<L> = <L as Simd>::f64s;

/// Vectors of `F32_LANES` numbers.
pub(crate) trait Lanes: Simd {
    /// Lanes for work that gathers short rows: four or eight.
    type Short: Lanes;

    fn short(self) -> Self::Short;

    /// a b + c.
    fn fused(self, a: Self::f32s, b: Self::f32s, c: Self::f32s) -> Self::f32s {
        self.mul_add_f32s(a, b, c)
    }

    /// a b + c.
    #[inline(always)]
    fn fused_double(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
        self.mul_add_f64s(a, b, c)
    }

    /// The first vector of `numbers`.
    #[inline(always)]
    fn load(self, numbers: &[f32]) -> Self::f32s {
        Self::as_simd_f32s(&numbers[..Self::F32_LANES]).0[0]
    }

    /// Writes the first vector of `numbers`.
    #[inline(always)]
    fn store(self, numbers: &mut [f32], vector: Self::f32s) {
        Self::as_mut_simd_f32s(&mut numbers[..Self::F32_LANES]).0[0] = vector;
    }

    /// The first vector of `numbers`.
    #[inline(always)]
    fn load_i32(self, numbers: &[i32]) -> Self::i32s {
        Self::as_simd_i32s(&numbers[..Self::F32_LANES]).0[0]
    }

    /// `sum` and the two products of the 16-bit numbers of `a` with those of `b`.
    #[inline(always)]
    fn add_pairs(self, a: Self::i32s, b: Self::i32s, sum: Self::i32s) -> Self::i32s {
        let mut lanes = [[0; MOST]; 3];
        for (lanes, vector) in lanes.iter_mut().zip([a, b, sum]) {
            Self::as_mut_simd_i32s(&mut lanes[..Self::F32_LANES]).0[0] = vector;
        }
        let [a, b, mut sum] = lanes;
        for i in 0..Self::F32_LANES {
            let (low, high) = (i32::from(a[i] as i16) * i32::from(b[i] as i16), (a[i] >> 16) * (b[i] >> 16));
            sum[i] += low + high;
        }
        self.load_i32(&sum)
    }

    /// The numbers of `whole`.
    #[inline(always)]
    fn to_f32(self, whole: Self::i32s) -> Self::f32s {
        let (mut from, mut to) = ([0; MOST], [0.0; MOST]);
        Self::as_mut_simd_i32s(&mut from[..Self::F32_LANES]).0[0] = whole;
        to.iter_mut().zip(from).for_each(|(x, n)| *x = n as f32);
        self.load(&to)
    }

    /// x, y and z of the first points of `numbers`, three each.
    #[inline(always)]
    fn load_points(self, numbers: &[f32]) -> [Self::f32s; 3] {
        let numbers = &numbers[..3 * Self::F32_LANES];
        let mut apart = [[0.0; MOST]; 3];
        for (i, point) in numbers.chunks_exact(3).enumerate() {
            (0..3).for_each(|d| apart[d][i] = point[d]);
        }
        let [x, y, z] = &apart;
        [self.load(x), self.load(y), self.load(z)]
    }

    /// Writes points as [`Self::load_points`] reads them.
    #[inline(always)]
    fn store_points(self, numbers: &mut [f32], points: [Self::f32s; 3]) {
        let numbers = &mut numbers[..3 * Self::F32_LANES];
        let mut apart = [[0.0; MOST]; 3];
        for (numbers, vector) in apart.iter_mut().zip(points) {
            self.store(numbers, vector);
        }
        for (i, point) in numbers.chunks_exact_mut(3).enumerate() {
            (0..3).for_each(|d| point[d] = apart[d][i]);
        }
    }

    /// The four numbers of group `group` of each of the first rows, one row a lane.
    #[inline(always)]
    fn columns<const GROUPS: usize>(self, rows: &[[[f32; 4]; GROUPS]], group: usize) -> [Self::f32s; 4] {
        let mut apart = [[0.0; MOST]; 4];
        for (i, row) in rows[..Self::F32_LANES].iter().enumerate() {
            (0..4).for_each(|d| apart[d][i] = row[group][d]);
        }
        let [a, b, c, d] = &apart;
        [self.load(a), self.load(b), self.load(c), self.load(d)]
    }
}

impl Lanes for Scalar128b {
    type Short = Self;

    #[inline(always)]
    fn short(self) -> Self {
        self
    }

    #[inline(always)]
    fn fused(self, a: Self::f32s, b: Self::f32s, c: Self::f32s) -> Self::f32s {
        self.add_f32s(self.mul_f32s(a, b), c)
    }

    #[inline(always)]
    fn fused_double(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
        self.add_f64s(self.mul_f64s(a, b), c)
    }
}

#[cfg(target_arch = "aarch64")]
impl Lanes for pulp::aarch64::Neon {
    type Short = Self;

    #[inline(always)]
    fn short(self) -> Self {
        self
    }

    #[inline(always)]
    fn add_pairs(self, a: i32x4, b: i32x4, sum: i32x4) -> i32x4 {
        let ([a, c], [b, d]): ([int16x4_t; 2], [int16x4_t; 2]) = (cast!(a), cast!(b));
        let (low, high) = (self.neon.vmull_s16(a, b), self.neon.vmull_s16(c, d));
        self.add_i32s(sum, cast!(self.neon.vpaddq_s32(low, high)))
    }

    #[inline(always)]
    fn to_f32(self, whole: i32x4) -> f32x4 {
        cast!(self.neon.vcvtq_f32_s32(cast!(whole)))
    }
}
