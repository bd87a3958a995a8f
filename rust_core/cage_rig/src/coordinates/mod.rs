//! Cage coordinates: how much each cage vertex moves each skin vertex.
//!
//! A kind of coordinates is a record in [`KINDS`]. Every kind gives rows that sum to 1 and
//! reproduce the point they belong to (linear precision): `Φ C₀ = M₀`.

mod degenerate;
mod lanes;
pub mod mean_value;
#[cfg(test)]
mod naive;
mod patch;
#[cfg(test)]
mod tests;

use crate::cage::Cage;
use crate::error::Error;
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;

/// A kind of cage coordinates.
#[derive(Debug, Clone, Copy)]
pub struct CoordinateKind {
    /// The name scripts use.
    pub name: &'static str,
    /// The name people read.
    pub label: &'static str,
    /// Φ, `#points by #C`, of points (`#points by 3`, rig space) with respect to a cage.
    pub compute: fn(&Cage, &[Point], &Part) -> Result<Rows, Cancelled>,
}

/// Every kind there is. The first one is the default.
pub const KINDS: &[CoordinateKind] =
    &[CoordinateKind { name: "mean_value", label: "Mean Value", compute: mean_value::coordinates }];

/// The kind called `name`.
pub fn kind(name: &str) -> Result<&'static CoordinateKind, Error> {
    KINDS.iter().find(|kind| kind.name == name).ok_or_else(|| Error::UnknownName {
        family: "kind of coordinates",
        name: name.to_owned(),
        known: KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", "),
    })
}
