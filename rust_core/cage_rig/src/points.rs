//! Points and the affine maps that move them.

/// A point or vector, in rig space.
pub type Point = nalgebra::Vector3<f64>;
/// A 3 by 3 matrix acting on columns.
pub type Matrix3 = nalgebra::Matrix3<f64>;

/// An affine map `v ↦ linear · v + translation`. The linear part may rotate, scale and shear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// R: the linear part.
    pub linear: Matrix3,
    /// t: where the origin goes.
    pub translation: Point,
}

impl Transform {
    /// The map that moves nothing.
    pub fn identity() -> Self {
        Self { linear: Matrix3::identity(), translation: Point::zeros() }
    }

    /// The image of `point`.
    pub fn apply(&self, point: &Point) -> Point {
        self.linear * point + self.translation
    }

    /// This map after `other`.
    pub fn after(&self, other: &Self) -> Self {
        Self { linear: self.linear * other.linear, translation: self.apply(&other.translation) }
    }

    /// The map that takes back what this one does; where its linear part has no inverse, its step alone.
    pub fn inverse(&self) -> Self {
        let linear = self.linear.try_inverse().unwrap_or_else(Matrix3::identity);
        Self { linear, translation: -(linear * self.translation) }
    }

    /// True when every entry is finite and at most [`LARGEST`].
    pub fn is_usable(&self) -> bool {
        self.linear.iter().chain(self.translation.iter()).all(is_usable)
    }
}

/// Beyond this, products of coordinates leave single precision, and of differences nothing is left.
pub const LARGEST: f64 = 1e12;

/// Whether a coordinate is finite and not so large that what is computed from it would not be.
pub(crate) fn is_usable(x: &f64) -> bool {
    x.abs() <= LARGEST
}

/// The index of the first point with a coordinate that is not usable.
pub(crate) fn first_unusable(points: &[Point]) -> Option<usize> {
    points.iter().position(|p| !p.iter().all(is_usable))
}

/// The diagonal of the bounding box of `points`: the *size* that every tolerance is relative to.
pub fn bounding_diagonal(points: &[Point]) -> f64 {
    let Some(first) = points.first() else { return 0.0 };
    let (low, high) = points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    (high - low).norm()
}

/// `points` in the single precision of the frame arrays.
pub(crate) fn to_f32(points: &[Point]) -> Vec<[f32; 3]> {
    points.iter().map(to_single).collect()
}

/// `point` in the single precision of the frame arrays.
pub(crate) fn to_single(point: &Point) -> [f32; 3] {
    [point.x as f32, point.y as f32, point.z as f32]
}
