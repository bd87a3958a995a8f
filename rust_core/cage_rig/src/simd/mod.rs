//! Vector instructions: one source for every kernel, chosen when the program runs.
//!
//! A kernel is written once against [`Lanes`] and compiled for each [`Path`]; [`Path::run`] enters the
//! chosen one. The intrinsics and their safe dispatch are pulp's. Plain loops in a function that was
//! compiled for AVX2 stay several times slower than sums held in named vectors, and a fused
//! multiply-add without the instruction is a library call, so the baseline multiplies and adds.

mod lanes;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use lanes::{Double, Lanes, Vector};

#[cfg(target_arch = "aarch64")]
use pulp::aarch64::Neon;
#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};
use pulp::{Scalar128b, Simd, WithSimd};

/// Instructions that this processor has and kernels are compiled for.
#[derive(Debug, Clone, Copy)]
pub struct Path(Instructions);

#[derive(Debug, Clone, Copy)]
enum Instructions {
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2(V3),
    #[cfg(target_arch = "x86_64")]
    Avx512(V4),
    #[cfg(target_arch = "aarch64")]
    Neon(Neon),
}

impl Default for Path {
    /// The fastest one.
    fn default() -> Self {
        Self::available().pop().unwrap_or(Self(Instructions::Baseline))
    }
}

impl Path {
    /// All paths that this processor can take, the fastest last.
    pub fn available() -> Vec<Self> {
        let mut paths = vec![Self(Instructions::Baseline)];
        #[cfg(target_arch = "x86_64")]
        {
            paths.extend(V3::try_new().map(|lanes| Self(Instructions::Avx2(lanes))));
            paths.extend(V4::try_new().map(|lanes| Self(Instructions::Avx512(lanes))));
        }
        #[cfg(target_arch = "aarch64")]
        paths.extend(Neon::try_new().map(|lanes| Self(Instructions::Neon(lanes))));
        paths
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self.0 {
            Instructions::Baseline => "baseline",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Instructions::Neon(_) => "neon",
        }
    }

    /// Runs `kernel` compiled for this path.
    pub(crate) fn run(self, kernel: impl Kernel) {
        match self.0 {
            Instructions::Baseline => enter(Scalar128b, kernel),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(lanes) => enter(lanes, kernel),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(lanes) => enter(lanes, kernel),
            #[cfg(target_arch = "aarch64")]
            Instructions::Neon(lanes) => enter(lanes, kernel),
        }
    }
}

/// Work written once for all lanes. `run` and all that it calls must be `#[inline(always)]`.
pub(crate) trait Kernel {
    fn run<L: Lanes>(self, lanes: L);
}

fn enter<L: Lanes>(lanes: L, kernel: impl Kernel) {
    struct Entered<L, K>(L, K);
    impl<L: Lanes, K: Kernel> WithSimd for Entered<L, K> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) {
            self.1.run(self.0);
        }
    }
    Simd::vectorize(lanes, Entered(lanes, kernel));
}
