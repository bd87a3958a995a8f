//! Joint coordinates Ψ: how the cage moves the joints.
//!
//! Based on [CTL*20] §4.1, Eq. (9–12): ψ_j = MEC(Σ_i mvc_ji · L_ji · φ_i), where mvc_j are the mean
//! value coordinates of joint j with respect to the skin, and the locality L_ji is high where bone
//! j blends with others, that is around the joint. Cost: `#J · #faces`, some joints at a time, and `#C` for
//! every skin weight.
//!
//! Where the paper is silent: a bone without weights, or whose weights blend nowhere, has no
//! locality. Its joint gets plain coordinates with respect to the cage, and is reported.

use super::max_entropy::max_entropy_coordinates;
use crate::cage::Cage;
use crate::coordinates::mean_value::{coordinates, Surface};
use crate::points::Point;
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use crate::weights::SkinWeights;
use rayon::prelude::*;

/// Joints that one thread takes at a time: as many as the widest vectors have lanes.
const TOGETHER: usize = 8;

/// Ψ and what had to be done for it.
#[derive(Debug, Clone)]
pub struct JointCoordinates {
    /// Ψ, `#J by #C`: rows sum to 1, Ψ C₀ = a₀.
    pub coords: Rows,
    /// Joints outside the convex hull of the cage: affine coordinates, some negative.
    pub outside_hull: Vec<usize>,
    /// Joints without locality: plain coordinates with respect to the cage.
    pub without_locality: Vec<usize>,
}

/// The skin at rest as the joints see it.
pub struct SkinAtRest<'a> {
    /// M₀, `#M by 3`, rig space.
    pub vertices: &'a [Point],
    /// Its triangles; none means that distance to the joint does not count.
    pub triangles: &'a [[u32; 3]],
    /// Ω, `#M by #J`.
    pub weights: &'a SkinWeights,
    /// Φ, `#M by #C`.
    pub cage_coords: &'a Rows,
    /// How much of the cage's movement each vertex takes part in, `#M`.
    pub reach: &'a [f64],
}

/// Ψ of `joints` (`#J by 3`). `exponent` is s of Eq. (9).
pub fn joint_coordinates(
    cage: &Cage,
    skin: &SkinAtRest,
    joints: &[Point],
    exponent: f64,
    part: &Part,
) -> Result<JointCoordinates, Cancelled> {
    let surface = Surface::new(skin.vertices, skin.triangles);
    let localities = joint_localities(skin.weights, exponent);
    let (count, width) = (part.count(joints.len()), skin.vertices.len());
    let packs = joints.par_chunks(TOGETHER).zip(localities.par_chunks(TOGETHER));
    let found = packs
        .map_init(Vec::new, |shares, (joints, localities)| {
            shares.resize(joints.len() * width, 1.0);
            if !skin.triangles.is_empty() {
                surface.weights(joints, shares, part)?;
            }
            let each = joints.iter().zip(localities).zip(shares.chunks_exact(width));
            let solve = |((joint, locality), shares): ((&Point, &Locality), &[f64])| {
                masses(skin, locality, shares).map(|m| max_entropy_coordinates(cage.vertices(), joint, &m))
            };
            count.step(joints.len())?;
            Ok(each.map(solve).collect::<Vec<_>>())
        })
        .collect::<Result<Vec<_>, Cancelled>>()?;
    let mut result = JointCoordinates {
        coords: coordinates(cage, joints, part)?,
        outside_hull: Vec::new(),
        without_locality: Vec::new(),
    };
    for (joint, solved) in found.into_iter().flatten().enumerate() {
        match solved {
            Some(solved) => {
                result.coords.row_mut(joint).copy_from_slice(&solved.coords);
                if !solved.inside {
                    result.outside_hull.push(joint);
                }
            }
            None => result.without_locality.push(joint),
        }
    }
    Ok(result)
}

/// L_ji of one joint: vertices and their value.
type Locality = Vec<(usize, f64)>;

/// m = Σ_i mvc_ji · L_ji · φ_i, Eq. (10), from the `shares` mvc_j; `None` where there is no locality.
fn masses(skin: &SkinAtRest, locality: &Locality, shares: &[f64]) -> Option<Vec<f64>> {
    if locality.iter().all(|&(_, l)| l <= 1e-12) {
        return None;
    }
    let mut masses = vec![0.0; skin.cage_coords.columns()];
    for &(vertex, locality) in locality {
        let factor = shares[vertex] * locality * skin.reach[vertex];
        masses.iter_mut().zip(skin.cage_coords.row(vertex)).for_each(|(m, phi)| *m += factor * phi);
    }
    masses.iter().any(|m| m.is_finite() && *m > 0.0).then_some(masses)
}

/// L_ji = −1 + ω_ij^s + (Σ_{k≠j} ω_ik)^s, Eq. (9), of every joint for the vertices where it is not 0. A
/// vertex without weights has none (the formula as printed would say −1).
fn joint_localities(weights: &SkinWeights, exponent: f64) -> Vec<Locality> {
    let mut localities = vec![Vec::new(); weights.joints()];
    for vertex in 0..weights.len() {
        for &(joint, w) in weights.row(vertex) {
            let value = -1.0 + w.powf(exponent) + (1.0 - w).max(0.0).powf(exponent);
            localities[joint as usize].push((vertex, value));
        }
    }
    localities
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn locality_is_high_where_bones_blend_and_nowhere_else() {
        let dense = [1.0, 0.0, 0.5, 0.5, 0.9, 0.1, 0.0, 1.0, 0.0, 0.0];
        let weights = SkinWeights::from_dense(&Rows::from_vec(5, 2, dense.to_vec()).expect("five rows"));
        let found = &joint_localities(&weights.expect("valid weights"), 0.1)[0];
        // L = −1 + ω^s + (1 − ω)^s, by hand; rows 3 and 4 have no weight for joint 0.
        let expected =
            [(0, 0.0), (1, 2.0 * 0.5f64.powf(0.1) - 1.0), (2, 0.9f64.powf(0.1) + 0.1f64.powf(0.1) - 1.0)];
        assert_eq!(found.len(), 3);
        assert!(found.iter().zip(&expected).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-12));
    }
}
