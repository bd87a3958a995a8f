//! What was done, and what is due.

/// How often something expensive was done since the bind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Work {
    /// Factorisations of Φ̃ (one, at bind).
    pub anchor_factorisations: usize,
    /// Factorisations of Eq. (19).
    pub reverse_factorisations: usize,
    /// Those of them by low rank.
    pub reverse_low_rank: usize,
    /// Solves with them.
    pub reverse_solves: usize,
    /// Products with Φ over the whole skin.
    pub rest_passes: usize,
    /// Those of them that read the columns of few cage vertices alone.
    pub rest_column_passes: usize,
    /// Those of them that read shapes of the cage instead.
    pub rest_shape_passes: usize,
    /// Skinnings of the whole skin.
    pub skin_passes: usize,
    /// Evaluations of Eq. (8).
    pub cage_fits: usize,
    /// Integrations of the centers of rotation.
    pub center_integrations: usize,
    /// Products with Λ over the whole skin.
    pub center_passes: usize,
    /// Those of them that read the columns of few cage vertices alone.
    pub center_column_passes: usize,
    /// Those of them that read shapes of the cage instead.
    pub center_shape_passes: usize,
}

/// Which of the large arrays are due.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stale {
    pub rest_skin: bool,
    pub posed_skin: bool,
    pub posed_cage: bool,
}
