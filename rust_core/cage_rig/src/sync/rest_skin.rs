//! The rest skin under an edited cage, in the frame's single precision.
//!
//! [CTL*20] Eq. (7), M = Φ C, in delta form: M = M₀ + Φ (C − C₀). Exact at rest whatever rounding
//! is in Φ, and only the columns of cage vertices that moved cost anything: `#M` per moved vertex.

use crate::panels::{Apart, Panels, Precision, Product, Step, Steps, FRAMES};
use crate::points::{bounding_diagonal, to_f32, to_single, Point};
use crate::progress::{unwatched, Cancelled, Part};
use crate::rows::Rows;
use crate::simd::Path;

/// M₀, C₀ and Φ.
#[derive(Debug, Clone)]
pub struct RestSkin {
    skin: Apart,
    cage: Vec<Point>,
    cage_size: f64,
    coords: Panels,
}

/// What takes part in a pass beside the cage.
#[derive(Debug, Clone, Copy)]
pub struct Confines<'a> {
    /// The instructions to use.
    pub path: Path,
    /// Of the cage's movement, the part at every vertex, `#M`; none: all of it.
    pub mask: Option<&'a [f32]>,
    /// Added at the end, `#M by 3`.
    pub offsets: Option<&'a [[f32; 3]]>,
}

impl RestSkin {
    /// Keeps `skin` (`#M by 3`) and `cage` (`#C by 3`) of the bind and `cage_coords`
    /// (`#M by #C`).
    pub fn new(
        skin: &[Point],
        cage: &[Point],
        cage_coords: &Rows,
        precision: Precision,
        part: &Part,
    ) -> Result<Self, Cancelled> {
        let coords = Panels::new(cage_coords, precision, part)?;
        let cage_size = bounding_diagonal(cage);
        Ok(Self { skin: Apart::new(&to_f32(skin)), cage: cage.to_vec(), cage_size, coords })
    }

    pub(super) fn precision(&self) -> Precision {
        self.coords.precision()
    }

    /// Keeps Φ (`cage_coords`) in another precision.
    pub(super) fn repack(&mut self, cage_coords: &Rows, precision: Precision) {
        self.coords = unwatched(|part| Panels::new(cage_coords, precision, part));
    }

    /// M₀, `#M by 3`.
    pub fn at_bind(&self) -> Vec<[f32; 3]> {
        self.skin.points()
    }

    pub(super) fn coords(&self) -> &Panels {
        &self.coords
    }

    /// M₀, to add to.
    pub(super) fn points(&self) -> &Apart {
        &self.skin
    }

    /// C₀, `#C by 3`.
    pub(super) fn cage(&self) -> &[Point] {
        &self.cage
    }

    /// The diagonal of its box.
    pub(super) fn cage_size(&self) -> f64 {
        self.cage_size
    }

    /// Leaves Φ times a movement of the cage (`by`, `#C by 3`) in `place`; `scratch` is written over (`#M by 3`).
    pub(super) fn keep_moves(
        &self,
        by: &[Point],
        path: Path,
        steps: &mut Steps,
        scratch: &mut [[f32; 3]],
        place: &mut Apart,
    ) {
        place.clear();
        steps.set(by.iter().enumerate().map(|(column, by)| Step { column, by: [to_single(by)] }));
        self.coords.write(&Product { path, from: place, mask: None, offsets: None }, steps, scratch);
        place.keep(scratch);
    }

    /// Writes M for `cage` from all columns that are not as bound.
    pub(super) fn write_whole(
        &self,
        cage: &[Point],
        confines: &Confines,
        steps: &mut Steps,
        rest: &mut [[f32; 3]],
    ) {
        let Confines { path, mask, offsets } = *confines;
        let moved = cage.iter().zip(&self.cage).enumerate().filter(|(_, (c, c0))| c != c0);
        steps.set(moved.map(|(column, (c, c0))| Step { column, by: [to_single(&(c - c0))] }));
        self.coords.write(&Product { path, from: &self.skin, mask, offsets }, steps, rest);
    }

    /// Writes M for one to four `cages` one after the other into `rest` (`4 · #M by 3`), from all columns
    /// that are not as bound.
    pub(super) fn write_frames(
        &self,
        cages: &[&[Point]],
        confines: &Confines,
        steps: &mut Steps,
        rest: &mut [[f32; 3]],
    ) {
        let count = self.skin.len();
        if let [cage] = cages {
            return self.write_whole(cage, confines, steps, &mut rest[..count]);
        }
        let Confines { path, mask, offsets } = *confines;
        let cage_of = |frame: usize| cages[frame.min(cages.len() - 1)];
        let by = |frame: usize, k: usize| to_single(&(cage_of(frame)[k] - self.cage[k]));
        let moved = (0..self.cage.len()).filter(|&k| cages.iter().any(|cage| cage[k] != self.cage[k]));
        let mut steps = Steps::<FRAMES>::default();
        steps.set(moved.map(|column| Step { column, by: std::array::from_fn(|f| by(f, column)) }));
        let (ab, cd) = rest.split_at_mut(2 * count);
        let ((a, b), (c, d)) = (ab.split_at_mut(count), cd.split_at_mut(count));
        self.coords.write_frames(
            &Product { path, from: &self.skin, mask, offsets },
            &mut steps,
            [a, b, c, d],
        );
    }
}
