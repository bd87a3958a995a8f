//! Points turned apart: what a product is added to, as its sums come.

use super::singles::Single;
use super::PANEL;

/// x, y and z of 32 points, then of the next ones; `#rows by 3`.
#[derive(Debug, Clone, Default)]
pub(crate) struct Apart {
    count: usize,
    panels: Vec<[Single; 3]>,
}

impl Apart {
    pub(crate) fn new(points: &[[f32; 3]]) -> Self {
        let mut found = Self::default();
        found.keep(points);
        found
    }

    /// Takes over `points`, in the memory of what was there.
    pub(crate) fn keep(&mut self, points: &[[f32; 3]]) {
        self.count = points.len();
        self.panels.resize(points.len().div_ceil(PANEL), [Single::ZERO; 3]);
        for (panel, points) in self.panels.iter_mut().zip(points.chunks(PANEL)) {
            for (r, point) in points.iter().enumerate() {
                (0..3).for_each(|d| panel[d].0[r] = point[d]);
            }
        }
    }

    /// So many points, all of them 0.
    pub(crate) fn zeros(count: usize) -> Self {
        Self { count, panels: vec![[Single::ZERO; 3]; count.div_ceil(PANEL)] }
    }

    /// Lets all points be 0.
    pub(crate) fn clear(&mut self) {
        self.panels.fill([Single::ZERO; 3]);
    }

    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// The points as they were.
    pub(crate) fn points(&self) -> Vec<[f32; 3]> {
        (0..self.count).map(|i| [0, 1, 2].map(|d| self.panels[i / PANEL][d].0[i % PANEL])).collect()
    }

    pub(super) fn panel(&self, panel: usize) -> &[Single; 3] {
        &self.panels[panel]
    }
}
