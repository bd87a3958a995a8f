//! Centers of rotation under an edited cage, for skinning methods that turn about them.
//!
//! [CTL*20] Eq. (14), p = Λ C. The same product as Eq. (7) with Λ for Φ, so in the same delta form:
//! p = p₀ + Λ (C − C₀), in single precision. Where the cage reaches the whole skin, p₀ = Λ C₀.

use super::rest_skin::RestSkin;
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;

/// Λ and the centers of the present rest cage.
#[derive(Debug, Clone)]
pub struct RestCenters {
    coords: Rows,
    mover: RestSkin,
    centers: Vec<[f32; 3]>,
    stale: bool,
}

impl RestCenters {
    /// Keeps `coords` (Λ, `#M by #C`), the centers `at_bind` (p₀, `#M by 3`) and `cage` (C₀, `#C by 3`).
    pub fn new(coords: Rows, at_bind: &[Point], cage: &[Point], part: &Part) -> Result<Self, Cancelled> {
        let mover = RestSkin::new(at_bind, cage, &coords, part)?;
        Ok(Self { coords, centers: mover.at_bind().to_vec(), mover, stale: true })
    }

    /// Λ.
    pub fn coords(&self) -> &Rows {
        &self.coords
    }

    /// What moves the rest skin has changed.
    pub fn invalidate(&mut self) {
        self.stale = true;
    }

    /// Makes the centers those of `cage` (C, `#C by 3`); true if that was work. A center takes part in
    /// what confines or offsets its vertex (`mask` and `offsets`, as of the rest skin).
    pub fn update(&mut self, cage: &[Point], mask: Option<&[f32]>, offsets: Option<&[[f32; 3]]>) -> bool {
        let work = self.stale;
        if work {
            self.mover.write(cage, mask, offsets, &mut self.centers);
            self.stale = false;
        }
        work
    }

    /// p, `#M by 3`, as of the last update.
    pub fn centers(&self) -> &[[f32; 3]] {
        &self.centers
    }
}
