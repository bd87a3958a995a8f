//! Mean value weights of a triangle that is seen edge-on.
//!
//! The components of the mean vector m of a spherical triangle with sides θ and corners α along the
//! directions to its corners are, after [JSW05], `(θ_i − cos α_j θ_k − cos α_k θ_j) sin θ_i / 2 det`.
//! From a point near the plane of a face, or near the line of one of its sides, numerator and
//! determinant both vanish and rounding is all that is left of their quotient. Here the numerators
//! are rearranged into terms that vanish as fast as they should.

use crate::points::Point;

/// A triangle as one point sees it. Side k is opposite corner k.
pub(super) struct Seen {
    /// Unit directions to the corners.
    pub(super) directions: [Point; 3],
    /// θ: the angles along the sides.
    pub(super) angles: [f64; 3],
    /// sin θ.
    pub(super) sines: [f64; 3],
    /// cos α, up to positive factors.
    pub(super) turns: [f64; 3],
    /// The determinant of the directions.
    pub(super) determinant: f64,
}

/// A side shorter than this part of the next one, or corners flatter than it, are degenerate.
const NARROW: f64 = 0.03;

impl Seen {
    /// The components, if this triangle is degenerate; `short` is its shortest side.
    pub(super) fn degenerate_components(&self, short: usize) -> Option<[f64; 3]> {
        let others = self.angles[(short + 1) % 3].min(self.angles[(short + 2) % 3]);
        let narrow = self.angles[short] / others;
        // Both at once happens: then the one that is farther gone is the one to mend.
        let numerators = self.arc(narrow.min(NARROW)).or_else(|| self.sliver(short, narrow))?;
        let components = std::array::from_fn(|k| numerators[k] * self.sines[k] / (2.0 * self.determinant));
        components.iter().all(|x: &f64| x.is_finite()).then_some(components)
    }

    /// sin α of the corner between sides i and j.
    fn corner_sine(&self, i: usize, j: usize) -> f64 {
        (self.determinant.abs() / (self.sines[i] * self.sines[j])).min(1.0)
    }

    /// Corners b and c in nearly the same direction: the line of side a passes near the point.
    /// θ_b − θ_c comes from cos θ_c − cos θ_b = u_a·(u_b − u_c).
    fn sliver(&self, a: usize, narrow: f64) -> Option<[f64; 3]> {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        let angles = &self.angles;
        if narrow > NARROW || angles[b].max(angles[c]) > 3.0 {
            return None;
        }
        // Across the mean direction, where rounding of the lengths does not count.
        let (step, mean) = (self.directions[c] - self.directions[b], self.directions[b] + self.directions[c]);
        let step = step - mean * (step.dot(&mean) / mean.norm_squared());
        let between = 0.5 * (angles[b] + angles[c]);
        let difference = 2.0 * (-0.5 * self.directions[a].dot(&step) / between.sin()).asin();
        let cosine = |corner: usize, sine: f64| (1.0 - sine * sine).sqrt() * self.turns[corner].signum();
        let cos_b = cosine(b, self.corner_sine(a, c));
        let cos_c = cosine(c, self.corner_sine(a, b));
        let flat = flatness(self.corner_sine(b, c));
        let mut numerators = [0.0; 3];
        numerators[a] = angles[a] - cos_b * angles[c] - cos_c * angles[b];
        numerators[b] = difference + flat * angles[c] - cos_c * angles[a];
        numerators[c] = -difference + flat * angles[b] - cos_b * angles[a];
        Some(numerators)
    }

    /// Corner a nearly on side a: the plane of the face passes near the point. θ_b + θ_c − θ_a
    /// comes from det² = 4 sin h sin(h − θ_a) sin(h − θ_b) sin(h − θ_c).
    fn arc(&self, flattest: f64) -> Option<[f64; 3]> {
        let (angles, turns) = (&self.angles, &self.turns);
        let obtuse = |k: usize| turns[k] < 0.0 && turns[(k + 1) % 3] > 0.0 && turns[(k + 2) % 3] > 0.0;
        let a = (0..3).find(|&k| obtuse(k))?;
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        let (sine_a, sine_b, sine_c) =
            (self.corner_sine(b, c), self.corner_sine(a, c), self.corner_sine(a, b));
        if sine_a.max(sine_b).max(sine_c) > flattest {
            return None;
        }
        let (flat_a, flat_b, flat_c) = (flatness(sine_a), flatness(sine_b), flatness(sine_c));
        let half = 0.5 * (angles[0] + angles[1] + angles[2]);
        let others = half.sin() * (half - angles[b]).sin() * (half - angles[c]).sin();
        let excess = 2.0 * (self.determinant * self.determinant / (4.0 * others)).asin();
        let mut numerators = [0.0; 3];
        numerators[a] = flat_b * angles[c] + flat_c * angles[b] - excess;
        numerators[b] = excess - flat_a * angles[c] + flat_c * angles[a];
        numerators[c] = excess - flat_a * angles[b] + flat_b * angles[a];
        Some(numerators)
    }
}

/// 1 − |cos α| from sin α.
fn flatness(sine: f64) -> f64 {
    sine * sine / (1.0 + (1.0 - sine * sine).sqrt())
}
