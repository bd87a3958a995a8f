//! A rest skin that follows few cage vertices: what is kept so that only their columns are read.
//!
//! While a drag moves the same few vertices, M = M_b + Φ_K (C − C_b)_K: M_b is the skin of a cage C_b
//! near by, made from M₀, and Φ_K the columns of the vertices that differ from it, copied
//! once. Nothing is added to what a drag itself has made, so nothing drifts however long it is.

use super::passes::{Columns, Pass};
use super::rest_skin::{Confines, RestSkin};
use crate::panels::{Apart, Factor, Panels, Step, Steps};
use crate::points::{to_single, Point};

/// A drag moves at most this part of the cage, and at most so many vertices.
const PART: usize = 4;
const MOST: usize = 16;

/// What a drag keeps between passes.
#[derive(Debug, Clone, Default)]
pub(super) struct Drag {
    /// C of the last pass; empty before it.
    last: Vec<Point>,
    /// The last pass was made from M₀, and wrote nothing but M.
    plain: bool,
    /// C_b, M_b and Φ_K; none before a drag.
    near: Option<Near>,
    /// Cage vertices that are elsewhere than in C_b.
    apart: Vec<usize>,
}

#[derive(Debug, Clone)]
struct Near {
    cage: Vec<Point>,
    skin: Apart,
    /// K.
    moved: Vec<usize>,
    columns: Panels,
}

impl Drag {
    /// Of a skin that rests in `cage` (C₀, `#C by 3`).
    pub(super) fn new(cage: &[Point]) -> Self {
        Self { last: cage.to_vec(), plain: true, apart: Vec::with_capacity(MOST + 1), ..Self::default() }
    }

    /// What the kept skin was made under has changed: all is forgotten but the memory.
    pub(super) fn forget(&mut self) {
        self.last.clear();
        self.near = None;
    }

    /// The few columns that lead to `cage`; `written` is what the last pass wrote. None
    /// where too much moves.
    pub(super) fn to(
        &mut self,
        cage: &[Point],
        skin: &RestSkin,
        confines: &Confines,
        written: &[[f32; 3]],
        steps: &mut Steps,
    ) -> Option<Columns<'_>> {
        let most = (cage.len() / PART).min(MOST);
        if !self.near.as_ref().is_some_and(|near| differ_in(cage, &near.cage, most, &mut self.apart)) {
            if self.last.is_empty() || !differ_in(cage, &self.last, most, &mut self.apart) {
                return None;
            }
            self.begin(skin, confines, written, steps);
        }
        let near = self.near.as_mut()?;
        near.take_in(&self.apart, skin);
        let by = |&k: &usize| to_single(&(cage[k] - near.cage[k]));
        let moved = near.moved.iter().enumerate();
        steps.set(moved.map(|(column, k)| Step { column, by: [by(k)] }));
        Some(Columns { factor: Factor::Panels(&near.columns), from: &near.skin })
    }

    /// A drag from where the last pass ended, in the memory of the one before it.
    fn begin(&mut self, skin: &RestSkin, confines: &Confines, written: &[[f32; 3]], steps: &mut Steps) {
        let mut place = self.near.take().map_or_else(Apart::default, |near| near.skin);
        if self.plain {
            place.keep(written);
        } else {
            let bare = Confines { offsets: None, ..*confines };
            let mut whole = written.to_vec();
            skin.write_whole(&self.last, &bare, steps, &mut whole);
            place.keep(&whole);
        }
        let columns = skin.coords().select(&[]);
        self.near = Some(Near { cage: self.last.clone(), skin: place, moved: Vec::new(), columns });
    }

    /// The pass to `cage` is done.
    pub(super) fn done(&mut self, cage: &[Point], pass: Pass, confines: &Confines) {
        self.plain = pass != Pass::Columns && confines.offsets.is_none();
        self.last.clear();
        self.last.extend_from_slice(cage);
    }
}

impl Near {
    /// Keeps the columns of all that is `apart` from C_b.
    fn take_in(&mut self, apart: &[usize], skin: &RestSkin) {
        if apart.iter().any(|k| !self.moved.contains(k)) {
            self.moved.extend(apart);
            self.moved.sort_unstable();
            self.moved.dedup();
            self.columns = skin.coords().select(&self.moved);
        }
    }
}

/// Whether two cages differ in at most so many vertices, which `apart` has then.
fn differ_in(a: &[Point], b: &[Point], most: usize, apart: &mut Vec<usize>) -> bool {
    apart.clear();
    let differing = a.iter().zip(b).enumerate().filter(|(_, (a, b))| a != b);
    apart.extend(differing.map(|(k, _)| k).take(most + 1));
    apart.len() <= most
}
