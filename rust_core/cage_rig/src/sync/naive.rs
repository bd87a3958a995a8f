//! Oracles of the cycle: Eq. (18) and (19) as matrices, inverted as printed.

use super::cage_updater::CageUpdater;
use crate::linalg::{product, Lu};
use crate::points::{Matrix3, Transform};
use crate::rows::Rows;
use crate::skeleton::Skeleton;

/// A_R and B_topo, `3 #J by 3 #J`, of A_R ∂A = B_topo ∂T, Eq. (16–18).
pub(super) fn hierarchy(skeleton: &Skeleton, linear: &[Matrix3]) -> (Rows, Rows) {
    let size = 3 * skeleton.len();
    let (mut turns, mut topology) = (Rows::zeros(size, size), Rows::zeros(size, size));
    for j in 0..skeleton.len() {
        match skeleton.parent(j) {
            // (17) (R_j − R_f) ∂a_j = ∂t_f − ∂t_j
            Some(f) => {
                put(&mut turns, j, j, linear[j] - linear[f]);
                put(&mut topology, j, f, Matrix3::identity());
                put(&mut topology, j, j, -Matrix3::identity());
            }
            // (16) (I − R_j) ∂a_j = ∂t_j
            None => {
                put(&mut turns, j, j, Matrix3::identity() - linear[j]);
                put(&mut topology, j, j, Matrix3::identity());
            }
        }
    }
    (turns, topology)
}

/// B_topo⁻¹ A_R Ψ, `3 #J by 3 #C`.
pub(super) fn translation_gradient(skeleton: &Skeleton, linear: &[Matrix3], joint_coords: &Rows) -> Rows {
    let (turns, topology) = hierarchy(skeleton, linear);
    product(&Lu::new(&topology).inverse(), &product(&turns, &spread(joint_coords)))
}

/// The left matrix of Eq. (19): R̃ Φ̃ + Ω̃ B_topo⁻¹ A_R Ψ, `3 #anchors by 3 #C`.
pub(super) fn reverse_matrix(cage: &CageUpdater, gradient: &Rows, linear: &[Matrix3]) -> Rows {
    let coords = spread(cage.anchor_coords());
    let mut turned = Rows::zeros(coords.len(), coords.len());
    let mut weights = Rows::zeros(cage.anchor_weights().len(), linear.len());
    for i in 0..weights.len() {
        let mut blend = Matrix3::zeros();
        let mut rest = 1.0;
        for &(j, w) in cage.anchor_weights().row(i) {
            weights.row_mut(i)[j as usize] = w;
            blend += linear[j as usize] * w;
            rest -= w;
        }
        put(&mut turned, i, i, blend + Matrix3::identity() * rest);
    }
    let mut system = product(&turned, &coords);
    let moved = product(&spread(&weights), gradient);
    system.as_mut_slice().iter_mut().zip(moved.as_slice()).for_each(|(a, b)| *a += b);
    system
}

/// One number as a 3 by 3 multiple of the identity.
pub(super) fn spread(rows: &Rows) -> Rows {
    let mut out = Rows::zeros(3 * rows.len(), 3 * rows.columns());
    for i in 0..rows.len() {
        for (k, w) in rows.row(i).iter().enumerate() {
            put(&mut out, i, k, Matrix3::identity() * *w);
        }
    }
    out
}

fn put(matrix: &mut Rows, row: usize, column: usize, block: Matrix3) {
    for d in 0..3 {
        for e in 0..3 {
            matrix.row_mut(3 * row + d)[3 * column + e] = block[(d, e)];
        }
    }
}

/// R_j of transforms.
pub(super) fn linear_parts(transforms: &[Transform]) -> Vec<Matrix3> {
    transforms.iter().map(|t| t.linear).collect()
}
