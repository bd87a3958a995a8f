//! Ω in single precision, as frames read it: four influences at a time.
//!
//! Rows come in *quads*, padded with weights of 0. Where no vertex has more than four influences its
//! quad is found by its index; elsewhere a vertex has as many quads as it needs. What a row lacks to 1
//! is an influence of one more bone that stands still, so that no kernel knows of such rows.

use crate::weights::SkinWeights;
use std::collections::HashMap;
use std::ops::Range;

/// Weights that lack less than this to 1 lack nothing but rounding.
const COMPLETE: f64 = 1e-6;
/// Influences of a quad.
pub(super) const QUAD: usize = 4;

/// Bones or pairs of bones of a quad.
pub(super) type Entries = [u32; QUAD];
/// Weights of a quad.
pub(super) type Weights = [f32; QUAD];

/// `#M by #J`.
#[derive(Debug, Clone)]
pub struct FrameWeights {
    vertices: usize,
    /// Of every quad its bones, the same as entries of `pairs`, and its weights; apart, because a method reads
    /// either bones or pairs.
    joints: Vec<Entries>,
    paired: Vec<Entries>,
    weights: Vec<Weights>,
    /// Where the quads of each vertex start, and the end; empty where every vertex has one.
    starts: Vec<u32>,
    pairs: Vec<[u32; 2]>,
}

impl FrameWeights {
    /// Packs `weights`.
    pub fn new(weights: &SkinWeights) -> Self {
        let still = weights.joints() as u32;
        let mut packed = Self {
            vertices: weights.len(),
            joints: Vec::with_capacity(weights.len()),
            paired: Vec::with_capacity(weights.len()),
            weights: Vec::with_capacity(weights.len()),
            starts: vec![0],
            pairs: Vec::new(),
        };
        let mut known = HashMap::new();
        for vertex in 0..weights.len() {
            let mut row = weights.row(vertex).to_vec();
            let lack = 1.0 - row.iter().map(|(_, weight)| weight).sum::<f64>();
            let heaviest = (0..row.len()).rev().max_by(|&a, &b| row[a].1.total_cmp(&row[b].1));
            let pivot = heaviest.map_or(still, |heaviest| row[heaviest].0);
            if lack > COMPLETE {
                row.push((still, lack));
            }
            for influences in row.chunks(QUAD) {
                let (mut joints, mut paired, mut parts) = ([pivot; QUAD], [0; QUAD], [0.0; QUAD]);
                let influences = influences.iter().map(|&(joint, weight)| (joint, weight as f32));
                for (k, (joint, weight)) in influences.chain([(pivot, 0.0); QUAD]).take(QUAD).enumerate() {
                    (joints[k], parts[k]) = (joint, weight);
                    paired[k] = *known.entry([pivot, joint]).or_insert_with(|| {
                        packed.pairs.push([pivot, joint]);
                        packed.pairs.len() as u32 - 1
                    });
                }
                packed.joints.push(joints);
                packed.paired.push(paired);
                packed.weights.push(parts);
            }
            packed.starts.push(packed.weights.len() as u32);
        }
        if packed.weights.len() == weights.len() {
            packed.starts.clear();
        }
        packed
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.vertices
    }

    /// True without vertices.
    pub fn is_empty(&self) -> bool {
        self.vertices == 0
    }

    /// Every (heaviest bone of a vertex, bone of that vertex) that there is.
    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// Of all quads the pairs, or the bones, and the weights.
    #[inline(always)]
    pub(super) fn quads(&self, paired: bool) -> (&[Entries], &[Weights]) {
        (if paired { &self.paired } else { &self.joints }, &self.weights)
    }

    /// Where the quads of `vertex` are; none where every vertex has the one of its index.
    #[inline(always)]
    pub(super) fn several(&self, vertex: usize) -> Option<Range<usize>> {
        let (start, end) = (self.starts.get(vertex)?, self.starts.get(vertex + 1)?);
        Some(*start as usize..*end as usize)
    }
}
