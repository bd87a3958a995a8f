//! Skinning methods: how the bones move the skin.
//!
//! A method is a record in [`METHODS`]. Every method leaves the skin where it is under identity
//! transforms, moves it rigidly when all transforms are the same rigid motion, and never moves a
//! vertex without weights.

pub mod lbs;
#[cfg(test)]
pub(crate) mod naive;
#[cfg(test)]
mod tests;

use crate::error::Error;
use crate::points::Transform;
use crate::weights::SkinWeights;

/// What a frame needs, whatever the method.
#[derive(Debug, Clone, Copy)]
pub struct SkinningInput<'a> {
    /// T, one per joint, rig space.
    pub transforms: &'a [Transform],
    /// Ω, packed for the frame.
    pub weights: &'a PackedWeights,
    /// M, `#M by 3`, rig space.
    pub rest_skin: &'a [[f32; 3]],
}

/// A skinning method.
#[derive(Debug, Clone, Copy)]
pub struct SkinningMethod {
    /// The name scripts use.
    pub name: &'static str,
    /// The name people read.
    pub label: &'static str,
    /// Writes M′ (`#M by 3`).
    pub pose: fn(&SkinningInput, &mut [[f32; 3]]),
}

/// Every method there is. The first one is the default.
pub const METHODS: &[SkinningMethod] =
    &[SkinningMethod { name: "lbs", label: "Linear Blend", pose: lbs::pose }];

/// The method called `name`.
pub fn method(name: &str) -> Result<&'static SkinningMethod, Error> {
    METHODS.iter().find(|method| method.name == name).ok_or_else(|| Error::UnknownName {
        family: "skinning method",
        name: name.to_owned(),
        known: METHODS.iter().map(|method| method.name).collect::<Vec<_>>().join(", "),
    })
}

/// Ω in single precision, as the frame reads it: the influences of vertex `i` are entries
/// `starts[i]..starts[i + 1]`.
#[derive(Debug, Clone)]
pub struct PackedWeights {
    pub(crate) starts: Vec<u32>,
    pub(crate) influences: Vec<(u32, f32)>,
}

impl PackedWeights {
    /// Packs `weights`.
    pub fn new(weights: &SkinWeights) -> Self {
        let mut packed = Self { starts: vec![0], influences: Vec::new() };
        for vertex in 0..weights.len() {
            packed
                .influences
                .extend(weights.row(vertex).iter().map(|&(joint, weight)| (joint, weight as f32)));
            packed.starts.push(packed.influences.len() as u32);
        }
        packed
    }
}
