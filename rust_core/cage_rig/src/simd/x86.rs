//! What AVX2 and AVX-512 do better than the plain way: points and rows turned in registers.
//!
//! Three shuffle instructions per vertex instead of one store per number.

use super::Lanes;
use pulp::x86::{V3, V4};
use pulp::{cast, f32x16, f32x8, i32x16, i32x8};
use std::arch::x86_64::{__m256, __m256d};

/// Four numbers below, four above.
#[inline(always)]
fn halves(low: &[f32], high: &[f32]) -> f32x8 {
    let mut both = [0.0f32; 8];
    both[..4].copy_from_slice(&low[..4]);
    both[4..].copy_from_slice(&high[..4]);
    cast!(both)
}

impl Lanes for V3 {
    type Short = Self;

    #[inline(always)]
    fn short(self) -> Self {
        self
    }

    #[inline(always)]
    fn add_pairs(self, a: i32x8, b: i32x8, sum: i32x8) -> i32x8 {
        let products = self.avx2._mm256_madd_epi16(cast!(a), cast!(b));
        cast!(self.avx2._mm256_add_epi32(cast!(sum), products))
    }

    #[inline(always)]
    fn to_f32(self, whole: i32x8) -> f32x8 {
        cast!(self.avx._mm256_cvtepi32_ps(cast!(whole)))
    }

    #[inline(always)]
    fn load_points(self, numbers: &[f32]) -> [f32x8; 3] {
        let n = &numbers[..24];
        // Points 0 to 3 in the lower halves, 4 to 7 in the upper ones: xyzx yzxy zxyz.
        let a: __m256 = cast!(halves(&n[0..], &n[12..]));
        let b: __m256 = cast!(halves(&n[4..], &n[16..]));
        let c: __m256 = cast!(halves(&n[8..], &n[20..]));
        let avx = self.avx;
        let xy = avx._mm256_shuffle_ps::<0b10_01_11_10>(b, c); // x2 y2 x3 y3
        let yz = avx._mm256_shuffle_ps::<0b01_00_10_01>(a, b); // y0 z0 y1 z1
        [
            cast!(avx._mm256_shuffle_ps::<0b10_00_11_00>(a, xy)),
            cast!(avx._mm256_shuffle_ps::<0b11_01_10_00>(yz, xy)),
            cast!(avx._mm256_shuffle_ps::<0b11_00_11_01>(yz, c)),
        ]
    }

    #[inline(always)]
    fn store_points(self, numbers: &mut [f32], [x, y, z]: [f32x8; 3]) {
        let n = &mut numbers[..24];
        let avx = self.avx;
        let (x, y, z): (__m256, __m256, __m256) = (cast!(x), cast!(y), cast!(z));
        let xy = avx._mm256_shuffle_ps::<0b10_00_10_00>(x, y); // x0 x2 y0 y2
        let yz = avx._mm256_shuffle_ps::<0b11_01_11_01>(y, z); // y1 y3 z1 z3
        let zx = avx._mm256_shuffle_ps::<0b11_01_10_00>(z, x); // z0 z2 x1 x3
        let a: [f32; 8] = cast!(avx._mm256_shuffle_ps::<0b10_00_10_00>(xy, zx)); // x0 y0 z0 x1
        let b: [f32; 8] = cast!(avx._mm256_shuffle_ps::<0b11_01_10_00>(yz, xy)); // y1 z1 x2 y2
        let c: [f32; 8] = cast!(avx._mm256_shuffle_ps::<0b11_01_11_01>(zx, yz)); // z2 x3 y3 z3
        for (at, part) in [(0, a), (4, b), (8, c)] {
            n[at..at + 4].copy_from_slice(&part[..4]);
            n[at + 12..at + 16].copy_from_slice(&part[4..]);
        }
    }

    #[inline(always)]
    fn columns<const GROUPS: usize>(self, rows: &[[[f32; 4]; GROUPS]], group: usize) -> [f32x8; 4] {
        let (avx, rows) = (self.avx, &rows[..8]);
        let a: __m256 = cast!(halves(&rows[0][group], &rows[4][group]));
        let b: __m256 = cast!(halves(&rows[1][group], &rows[5][group]));
        let c: __m256 = cast!(halves(&rows[2][group], &rows[6][group]));
        let d: __m256 = cast!(halves(&rows[3][group], &rows[7][group]));
        let ab: __m256d = cast!(avx._mm256_unpacklo_ps(a, b)); // a0 b0 a1 b1
        let cd: __m256d = cast!(avx._mm256_unpacklo_ps(c, d));
        let above_ab: __m256d = cast!(avx._mm256_unpackhi_ps(a, b)); // a2 b2 a3 b3
        let above_cd: __m256d = cast!(avx._mm256_unpackhi_ps(c, d));
        [
            cast!(avx._mm256_unpacklo_pd(ab, cd)),
            cast!(avx._mm256_unpackhi_pd(ab, cd)),
            cast!(avx._mm256_unpacklo_pd(above_ab, above_cd)),
            cast!(avx._mm256_unpackhi_pd(above_ab, above_cd)),
        ]
    }
}

impl Lanes for V4 {
    type Short = V3;

    #[inline(always)]
    fn short(self) -> V3 {
        *self
    }

    #[inline(always)]
    fn add_pairs(self, a: i32x16, b: i32x16, sum: i32x16) -> i32x16 {
        let products = self.avx512bw._mm512_madd_epi16(cast!(a), cast!(b));
        cast!(self.avx512f._mm512_add_epi32(cast!(sum), products))
    }

    #[inline(always)]
    fn to_f32(self, whole: i32x16) -> f32x16 {
        cast!(self.avx512f._mm512_cvtepi32_ps(cast!(whole)))
    }

    #[inline(always)]
    fn load_points(self, numbers: &[f32]) -> [f32x16; 3] {
        let short = self.short();
        let ([a, b, c], [d, e, f]) = (short.load_points(&numbers[..24]), short.load_points(&numbers[24..]));
        [cast!([a, d]), cast!([b, e]), cast!([c, f])]
    }

    #[inline(always)]
    fn store_points(self, numbers: &mut [f32], [x, y, z]: [f32x16; 3]) {
        let short = self.short();
        let (x, y, z): ([f32x8; 2], [f32x8; 2], [f32x8; 2]) = (cast!(x), cast!(y), cast!(z));
        short.store_points(&mut numbers[..24], [x[0], y[0], z[0]]);
        short.store_points(&mut numbers[24..], [x[1], y[1], z[1]]);
    }

    #[inline(always)]
    fn columns<const GROUPS: usize>(self, rows: &[[[f32; 4]; GROUPS]], group: usize) -> [f32x16; 4] {
        let short = self.short();
        let ([a, b, c, d], [e, f, g, h]) =
            (short.columns(&rows[..8], group), short.columns(&rows[8..], group));
        [cast!([a, e]), cast!([b, f]), cast!([c, g]), cast!([d, h])]
    }
}
