//! Skinning methods: how the bones move the skin.
//!
//! A method is a record in [`METHODS`]. Every method leaves the skin where it is under identity
//! transforms, moves it rigidly when all transforms are the same rigid motion, and never moves a
//! vertex without weights.

mod blocks;
#[cfg(test)]
mod center_tests;
pub mod centers;
pub mod cor;
pub mod dqs;
mod frame_weights;
pub mod lbs;
#[cfg(test)]
pub(crate) mod naive;
pub mod rotation;
mod scratch;
#[cfg(test)]
mod tests;
mod vectors;

pub use frame_weights::FrameWeights;
pub use scratch::Scratch;

use crate::error::Error;
use crate::points::Transform;
use crate::simd::Path;
use crate::weights::SkinWeights;

/// What a frame needs, whatever the method.
#[derive(Debug, Clone, Copy)]
pub struct SkinningInput<'a> {
    /// The instructions to use.
    pub path: Path,
    /// T, one per joint, rig space.
    pub transforms: &'a [Transform],
    /// Ω, packed for the frame.
    pub weights: &'a FrameWeights,
    /// M, `#M by 3`, rig space.
    pub rest_skin: &'a [[f32; 3]],
    /// p, `#M by 3`, rig space; read by methods that have `centers`.
    pub centers: &'a [[f32; 3]],
}

/// A skinning method.
#[derive(Debug, Clone, Copy)]
pub struct SkinningMethod {
    /// The number files keep; never changes.
    pub number: u8,
    /// The name scripts use.
    pub name: &'static str,
    /// The name people read.
    pub label: &'static str,
    /// Does it turn about centers of rotation?
    pub centers: bool,
    /// Writes M′ (`#M by 3`).
    pub pose: fn(&SkinningInput, &mut Scratch, &mut [[f32; 3]]),
}

/// Every method there is. The first one is the default; a new one takes the next number.
pub const METHODS: &[SkinningMethod] = &[
    SkinningMethod { number: 0, name: "lbs", label: "Linear Blend", centers: false, pose: lbs::pose },
    SkinningMethod { number: 1, name: "dqs", label: "Dual Quaternion", centers: false, pose: dqs::pose },
    SkinningMethod { number: 2, name: "cor", label: "Centers of Rotation", centers: true, pose: cor::pose },
];

/// The method called `name`.
pub fn method(name: &str) -> Result<&'static SkinningMethod, Error> {
    METHODS.iter().find(|method| method.name == name).ok_or_else(|| Error::UnknownName {
        family: "skinning method",
        name: name.to_owned(),
        known: METHODS.iter().map(|method| method.name).collect::<Vec<_>>().join(", "),
    })
}

/// Ω in single precision, as integrals read it: the influences of vertex `i` are entries
/// `starts[i]..starts[i + 1]`, the largest (the first of equal ones) in front.
#[derive(Debug, Clone)]
pub struct PackedWeights {
    starts: Vec<u32>,
    influences: Vec<(u32, f32)>,
}

impl PackedWeights {
    /// Packs `weights`.
    pub fn new(weights: &SkinWeights) -> Self {
        let mut packed = Self { starts: vec![0], influences: Vec::new() };
        for vertex in 0..weights.len() {
            let start = packed.influences.len();
            let row = weights.row(vertex).iter().map(|&(joint, weight)| (joint, weight as f32));
            packed.influences.extend(row);
            let row = &mut packed.influences[start..];
            if let Some(largest) = (0..row.len()).rev().max_by(|&a, &b| row[a].1.total_cmp(&row[b].1)) {
                row[..=largest].rotate_right(1);
            }
            packed.starts.push(packed.influences.len() as u32);
        }
        packed
    }

    /// The influences of `vertex`.
    #[inline]
    pub fn row(&self, vertex: usize) -> &[(u32, f32)] {
        &self.influences[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}
