//! A rest skin whose cage goes through few shapes: what is kept so that Φ is not read.
//!
//! A keyed cage goes in a straight line from key to key, and stays in the span of a few shapes where several are
//! at work: C − C₀ = Σ t_s D_s, so M = M₀ + Σ t_s Φ D_s with three numbers per vertex and shape in the place of `#C`.
//! Nobody says what the shapes are: a movement that those before it do not make up is one more, as what they leave
//! of it, and Φ D_s is made once a later movement is found in their span. Every cage is compared with what it is
//! taken for, vertex by vertex, so nothing is assumed of where it comes from, and a cage that moves freely costs
//! the comparison alone.

use super::passes::Columns;
use super::rest_skin::RestSkin;
use crate::panels::{Apart, Factor, Step, Steps};
use crate::points::Point;
use crate::simd::Path;

/// Shapes at most; where one more is met, all are forgotten.
const MOST: usize = 3;
/// No cage vertex is farther from what its cage is taken for, in parts of the cage's size: a quarter of what
/// frames may be off by, and more than single precision rounds a cage between keys by.
const ROUNDING: f64 = 2.5e-7;
/// A shape that was seen so much smaller than it is needed is taken anew where it does not fit.
const FAR: f64 = 2.0;
/// Cages with fewer vertices than this many times what shapes read gain nothing.
const GAIN: usize = 2;

/// What cages were seen in, and Φ times it.
#[derive(Debug, Clone, Default)]
pub(super) struct Shapes {
    /// D, each orthogonal to those before it; the first `seen` of them.
    shapes: [Shape; MOST],
    seen: usize,
    /// Φ D of the first `made` of them; the memory for all is taken when the cage first moves.
    moves: Vec<Apart>,
    made: usize,
    /// What is left of the present movement.
    left: Vec<Point>,
}

#[derive(Debug, Clone, Default)]
struct Shape {
    by: Vec<Point>,
    /// ‖D‖².
    square: f64,
    /// t of the present movement.
    part: f64,
}

impl Shapes {
    /// Of a cage of so many vertices.
    pub(super) fn new(vertices: usize) -> Self {
        let shapes = std::array::from_fn(|_| Shape { by: Vec::with_capacity(vertices), ..Shape::default() });
        Self { shapes, left: Vec::with_capacity(vertices), ..Self::default() }
    }

    pub(super) fn forget(&mut self) {
        self.keep(0);
    }

    /// The shapes that `cage` is made up of; none where it is not. `scratch` may be written over (`#M by 3`).
    pub(super) fn to<'a>(
        &'a mut self,
        cage: &[Point],
        skin: &'a RestSkin,
        path: Path,
        scratch: &mut [[f32; 3]],
        steps: &mut Steps,
    ) -> Option<Columns<'a>> {
        if cage.len() < GAIN * 3 * MOST {
            return None;
        }
        if self.moves.is_empty() {
            self.moves.resize_with(MOST, || Apart::zeros(scratch.len()));
        }
        let near = ROUNDING * skin.cage_size();
        self.left.clear();
        self.left.extend(cage.iter().zip(skin.cage()).map(|(c, c0)| c - c0));
        let Self { shapes, left, .. } = self;
        shapes[..self.seen].iter_mut().for_each(|shape| shape.take_from(left, near));
        if left.iter().any(|left| left.amax() > near) {
            self.learn();
            return None;
        }
        for (shape, place) in self.shapes.iter().zip(&mut self.moves).take(self.seen).skip(self.made) {
            skin.keep_moves(&shape.by, path, steps, scratch, place);
        }
        self.made = self.seen;
        let parts = self.shapes[..self.seen].iter().map(|shape| shape.part).enumerate();
        steps.set(parts.filter(|(_, t)| *t != 0.0).map(|(column, t)| Step { column, by: [[t as f32; 3]] }));
        Some(Columns { factor: Factor::Shapes(&self.moves), from: skin.points() })
    }

    /// One more shape: what those that are kept leave of the present movement.
    fn learn(&mut self) {
        let far = self.shapes[..self.seen].iter().position(|shape| shape.part.abs() > FAR);
        let kept = far.unwrap_or(if self.seen < MOST { self.seen } else { 0 });
        let Self { shapes, left, .. } = self;
        shapes[kept..self.seen].iter().for_each(|shape| shape.give_to(left));
        shapes[kept].take_over(left);
        self.keep(kept);
        self.seen += 1;
    }

    /// Forgets all but the first `count`.
    fn keep(&mut self, count: usize) {
        self.seen = self.seen.min(count);
        self.made = self.made.min(count);
    }
}

impl Shape {
    /// Takes its part from what is `left`, where that is farther than `near`.
    fn take_from(&mut self, left: &mut [Point], near: f64) {
        let along: f64 = left.iter().zip(&self.by).map(|(left, by)| left.dot(by)).sum();
        self.part = if along * along > near * near * self.square { along / self.square } else { 0.0 };
        if self.part != 0.0 {
            left.iter_mut().zip(&self.by).for_each(|(left, by)| *left -= self.part * by);
        }
    }

    fn give_to(&self, left: &mut [Point]) {
        left.iter_mut().zip(&self.by).for_each(|(left, by)| *left += self.part * by);
    }

    fn take_over(&mut self, left: &[Point]) {
        self.by.clear();
        self.by.extend_from_slice(left);
        self.square = left.iter().map(Point::norm_squared).sum();
    }
}
