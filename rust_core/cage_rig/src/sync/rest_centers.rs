//! Centers of rotation under an edited cage, for skinning methods that turn about them.
//!
//! [CTL*20] Eq. (14), p = Λ C. The same product as Eq. (7) with Λ for Φ, so in the same delta form:
//! p = p₀ + Λ (C − C₀), in single precision. Where the cage reaches the whole skin, p₀ = Λ C₀.

use super::passes::{Kept, Pass};
use super::rest_skin::{Confines, RestSkin};
use crate::panels::Precision;
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;

/// Λ and the centers of the present rest cage.
#[derive(Debug, Clone)]
pub struct RestCenters {
    coords: Rows,
    mover: RestSkin,
    centers: Vec<[f32; 3]>,
    kept: Kept,
    stale: bool,
}

impl RestCenters {
    /// Keeps `coords` (Λ, `#M by #C`), the centers `at_bind` (p₀, `#M by 3`) and `cage` (C₀, `#C by 3`).
    pub fn new(
        coords: Rows,
        at_bind: &[Point],
        cage: &[Point],
        precision: Precision,
        part: &Part,
    ) -> Result<Self, Cancelled> {
        let mover = RestSkin::new(at_bind, cage, &coords, precision, part)?;
        Ok(Self { coords, centers: mover.at_bind(), mover, kept: Kept::new(cage), stale: true })
    }

    pub(super) fn mover(&self) -> &RestSkin {
        &self.mover
    }

    /// Λ.
    pub fn coords(&self) -> &Rows {
        &self.coords
    }

    /// Keeps Λ in this precision.
    pub(super) fn repack(&mut self, precision: Precision) {
        if precision != self.mover.precision() {
            self.mover.repack(&self.coords, precision);
            self.forget();
        }
    }

    /// What moves the rest skin has changed.
    pub fn invalidate(&mut self) {
        self.stale = true;
    }

    /// Whether centers depend on nothing that was before them.
    pub(super) fn set_reproducible(&mut self, reproducible: bool) {
        self.stale = true;
        self.kept.set_whole(reproducible);
    }

    /// What confines the rest skin has changed.
    pub fn forget(&mut self) {
        self.stale = true;
        self.kept.forget();
    }

    /// Makes the centers those of `cage` (C, `#C by 3`); the pass that this took, if any. A center takes
    /// part in what confines or offsets its vertex.
    pub fn update(&mut self, cage: &[Point], confines: &Confines) -> Option<Pass> {
        let due = std::mem::take(&mut self.stale);
        due.then(|| self.kept.pass(&self.mover, cage, confines, &mut self.centers))
    }

    /// p, `#M by 3`, as of the last update.
    pub fn centers(&self) -> &[[f32; 3]] {
        &self.centers
    }
}
