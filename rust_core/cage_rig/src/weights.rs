//! Skin weights Ω: which joints move which vertex, and how much.

use crate::error::WeightsError;
use crate::points::is_usable;
use crate::rows::Rows;

/// Ω, `#M by #J`, one sparse row per vertex. Every row sums to 1, or is empty: such a vertex is
/// not moved by the skeleton. Rows built from others may sum to less: what is missing to 1
/// stands still (see [`crate::skinning::lbs`]).
#[derive(Debug, Clone, PartialEq)]
pub struct SkinWeights {
    joints: usize,
    starts: Vec<usize>,
    influences: Vec<(u32, f64)>,
}

impl SkinWeights {
    /// From a dense matrix `#M by #J`; zeros are dropped and rows normalised.
    pub fn from_dense(dense: &Rows) -> Result<Self, WeightsError> {
        let mut weights = Self { joints: dense.columns(), starts: vec![0], influences: Vec::new() };
        for vertex in 0..dense.len() {
            let row = dense.row(vertex).iter().enumerate().map(|(joint, &weight)| (joint as i64, weight));
            weights.push_row(vertex, row)?;
        }
        Ok(weights)
    }

    /// From compressed rows: row `i` holds entries `indptr[i]..indptr[i + 1]` of `indices` (the
    /// joints) and `data` (the weights). A joint may come twice in a row: its weights add up.
    pub fn from_compressed(
        joints: usize,
        indptr: &[i64],
        indices: &[i64],
        data: &[f64],
    ) -> Result<Self, WeightsError> {
        if indices.len() != data.len() {
            return Err(WeightsError::Lengths { indices: indices.len(), data: data.len() });
        }
        if indptr.first() != Some(&0) {
            return Err(WeightsError::BadIndptr { entry: 0, data: data.len() });
        }
        if let Some(fall) = indptr.windows(2).position(|pair| pair[1] < pair[0]) {
            return Err(WeightsError::BadIndptr { entry: fall + 1, data: data.len() });
        }
        if indptr.last() != Some(&(data.len() as i64)) {
            return Err(WeightsError::BadIndptr { entry: indptr.len() - 1, data: data.len() });
        }
        let mut weights = Self { joints, starts: vec![0], influences: Vec::new() };
        for (vertex, pair) in indptr.windows(2).enumerate() {
            let range = pair[0] as usize..pair[1] as usize;
            weights.push_row(vertex, range.map(|k| (indices[k], data[k])))?;
        }
        Ok(weights)
    }

    /// Rows as they are, not normalised: for weights blended from normalised ones.
    pub(crate) fn from_blended(dense: &Rows) -> Self {
        let mut weights = Self { joints: dense.columns(), starts: vec![0], influences: Vec::new() };
        for vertex in 0..dense.len() {
            let row = dense.row(vertex).iter().enumerate().filter(|(_, w)| **w != 0.0);
            weights.influences.extend(row.map(|(joint, &w)| (joint as u32, w)));
            weights.starts.push(weights.influences.len());
        }
        weights
    }

    fn push_row(&mut self, vertex: usize, row: impl Iterator<Item = (i64, f64)>) -> Result<(), WeightsError> {
        let start = self.influences.len();
        for (joint, weight) in row {
            let Some(index) = usize::try_from(joint).ok().filter(|&j| j < self.joints) else {
                return Err(WeightsError::BadJoint { vertex, joint, joints: self.joints });
            };
            if !is_usable(&weight) {
                return Err(WeightsError::NotFinite { vertex, joint: index });
            }
            if weight < 0.0 {
                return Err(WeightsError::Negative { vertex, joint: index, weight });
            }
            match self.influences[start..].iter_mut().find(|(j, _)| *j as usize == index) {
                Some((_, known)) => *known += weight,
                None if weight > 0.0 => self.influences.push((index as u32, weight)),
                None => {}
            }
        }
        // Dividing by the largest first keeps subnormal rows from overflowing.
        let row = &mut self.influences[start..];
        let largest = row.iter().fold(0.0, |most: f64, (_, w)| most.max(*w));
        row.iter_mut().for_each(|(_, w)| *w /= largest);
        let sum: f64 = row.iter().map(|(_, w)| w).sum();
        row.iter_mut().for_each(|(_, w)| *w /= sum);
        self.starts.push(self.influences.len());
        Ok(())
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// True without vertices.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// The influences of `vertex`: joint and weight.
    pub fn row(&self, vertex: usize) -> &[(u32, f64)] {
        &self.influences[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// The rows of `vertices`, in that order.
    pub(crate) fn select(&self, vertices: &[usize]) -> Self {
        let mut chosen = Self { joints: self.joints, starts: vec![0], influences: Vec::new() };
        for &vertex in vertices {
            chosen.influences.extend_from_slice(self.row(vertex));
            chosen.starts.push(chosen.influences.len());
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(columns: usize, data: &[f64]) -> Rows {
        Rows::from_vec(data.len() / columns, columns, data.to_vec()).expect("sizes agree")
    }

    #[test]
    fn rows_sum_to_one_or_are_empty() {
        let weights = SkinWeights::from_dense(&dense(2, &[0.5, 1.5, 0.0, 0.0, 0.0, 1e-310])).expect("valid");
        assert_eq!(weights.row(0), [(0, 0.25), (1, 0.75)]);
        assert_eq!(weights.row(1), []);
        assert_eq!(weights.row(2), [(1, 1.0)]);
    }

    #[test]
    fn compressed_and_dense_rows_agree() {
        let a = SkinWeights::from_dense(&dense(3, &[1.0, 0.0, 3.0, 0.0, 0.0, 0.0])).expect("valid");
        let b = SkinWeights::from_compressed(3, &[0, 3, 3], &[0, 2, 2], &[1.0, 1.0, 2.0]).expect("valid");
        assert_eq!(a, b);
    }

    #[test]
    fn impossible_weights_are_refused_by_vertex_and_joint() {
        assert_eq!(
            SkinWeights::from_dense(&dense(2, &[1.0, 0.0, 0.5, -0.5])).err(),
            Some(WeightsError::Negative { vertex: 1, joint: 1, weight: -0.5 })
        );
        assert_eq!(
            SkinWeights::from_dense(&dense(1, &[1.0, f64::NAN])).err(),
            Some(WeightsError::NotFinite { vertex: 1, joint: 0 })
        );
        let compressed = |indptr: &[i64], indices: &[i64]| {
            SkinWeights::from_compressed(2, indptr, indices, &[1.0, 1.0]).err()
        };
        assert_eq!(
            compressed(&[0, 1, 2], &[0, 2]),
            Some(WeightsError::BadJoint { vertex: 1, joint: 2, joints: 2 })
        );
        assert_eq!(compressed(&[0, 1, 2], &[0]), Some(WeightsError::Lengths { indices: 1, data: 2 }));
        assert_eq!(compressed(&[0, 2, 1], &[0, 1]), Some(WeightsError::BadIndptr { entry: 2, data: 2 }));
        assert_eq!(compressed(&[0, 1], &[0, 1]), Some(WeightsError::BadIndptr { entry: 1, data: 2 }));
        assert_eq!(compressed(&[1, 2], &[0, 1]), Some(WeightsError::BadIndptr { entry: 0, data: 2 }));
    }
}
