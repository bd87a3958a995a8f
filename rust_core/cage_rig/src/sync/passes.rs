//! How a rest skin is made anew: from few columns of Φ, from few shapes of the cage, or from all of Φ.

use super::drag::Drag;
use super::rest_skin::{Confines, RestSkin};
use super::shapes::Shapes;
use crate::panels::{Apart, Factor, Product, Steps};
use crate::points::Point;

/// How a pass was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pass {
    /// From all columns that are not as bound.
    Whole,
    /// From the columns of few vertices.
    Columns,
    /// From shapes that the cage was seen in.
    Shapes,
}

/// What is multiplied in the place of Φ, and what that is added to.
pub(super) struct Columns<'a> {
    pub(super) factor: Factor<'a>,
    pub(super) from: &'a Apart,
}

/// What a rest skin (or centers) keeps between passes.
#[derive(Debug, Clone, Default)]
pub struct Kept {
    drag: Drag,
    shapes: Shapes,
    /// Every pass is made from all of Φ.
    whole: bool,
    /// Of the present pass.
    pub(super) steps: Steps,
}

impl Kept {
    /// Of a skin that rests in `cage` (C₀, `#C by 3`).
    pub fn new(cage: &[Point]) -> Self {
        Self { drag: Drag::new(cage), shapes: Shapes::new(cage.len()), ..Self::default() }
    }

    /// What the kept skin was made under has changed: all is forgotten but the memory.
    pub fn forget(&mut self) {
        self.drag.forget();
        self.shapes.forget();
    }

    /// From now on passes depend on nothing that was before them, or are as fast as can be.
    pub(super) fn set_whole(&mut self, whole: bool) {
        self.whole = whole;
        self.forget();
    }

    /// Writes M of `skin` (`#M by 3`) for `cage` (C, `#C by 3`) over `rest`, which the last pass wrote.
    pub(super) fn pass(
        &mut self,
        skin: &RestSkin,
        cage: &[Point],
        confines: &Confines,
        rest: &mut [[f32; 3]],
    ) -> Pass {
        let Self { drag, shapes, whole, steps } = self;
        let mut found = None;
        if !*whole {
            found = drag.to(cage, skin, confines, rest, steps).map(|columns| (columns, Pass::Columns));
        }
        if found.is_none() && !*whole {
            found = shapes.to(cage, skin, confines.path, rest, steps).map(|columns| (columns, Pass::Shapes));
        }
        let pass = match found {
            Some((Columns { factor, from }, pass)) => {
                let Confines { path, mask, offsets } = *confines;
                factor.write(&Product { path, from, mask, offsets }, steps, rest);
                pass
            }
            None => {
                skin.write_whole(cage, confines, steps, rest);
                Pass::Whole
            }
        };
        drag.done(cage, pass, confines);
        pass
    }
}
