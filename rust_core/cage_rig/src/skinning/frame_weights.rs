//! Ω in single precision, as frames read it: four influences at a time.
//!
//! Rows come in *quads*, padded with weights of 0. Where no vertex has more than four influences its
//! quad is found by its index; elsewhere a vertex has as many quads as it needs. What a row lacks to 1
//! is an influence of one more bone that stands still, so that no kernel knows of such rows.

use crate::weights::SkinWeights;
use std::collections::HashMap;

/// Weights that lack less than this to 1 lack nothing but rounding.
const COMPLETE: f64 = 1e-6;
/// Influences of a quad.
pub(super) const QUAD: usize = 4;

/// Four influences of one vertex.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Quad {
    /// Bones.
    pub(super) joints: [u32; QUAD],
    /// Entries of [`FrameWeights::pairs`].
    pub(super) pairs: [u32; QUAD],
    pub(super) weights: [f32; QUAD],
}

/// `#M by #J`.
#[derive(Debug, Clone)]
pub struct FrameWeights {
    vertices: usize,
    quads: Vec<Quad>,
    /// Where the quads of each vertex start, and the end; empty where every vertex has one.
    starts: Vec<u32>,
    pairs: Vec<[u32; 2]>,
}

impl FrameWeights {
    /// Packs `weights`.
    pub fn new(weights: &SkinWeights) -> Self {
        let still = weights.joints() as u32;
        let (mut quads, mut starts, mut pairs) = (Vec::with_capacity(weights.len()), vec![0], Vec::new());
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
                let mut quad = Quad { joints: [pivot; QUAD], ..Quad::default() };
                let influences = influences.iter().map(|&(joint, weight)| (joint, weight as f32));
                for (k, (joint, weight)) in influences.chain([(pivot, 0.0); QUAD]).take(QUAD).enumerate() {
                    (quad.joints[k], quad.weights[k]) = (joint, weight);
                    quad.pairs[k] = *known.entry([pivot, joint]).or_insert_with(|| {
                        pairs.push([pivot, joint]);
                        pairs.len() as u32 - 1
                    });
                }
                quads.push(quad);
            }
            starts.push(quads.len() as u32);
        }
        if quads.len() == weights.len() {
            starts.clear();
        }
        Self { vertices: weights.len(), quads, starts, pairs }
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

    /// All quads, for vertices that have one each.
    #[inline(always)]
    pub(super) fn single(&self) -> Option<&[Quad]> {
        self.starts.is_empty().then_some(&self.quads)
    }

    /// The quads of `vertex` where [`Self::single`] is none.
    #[inline(always)]
    pub(super) fn several(&self, vertex: usize) -> &[Quad] {
        &self.quads[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}
