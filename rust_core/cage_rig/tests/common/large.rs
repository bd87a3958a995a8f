//! Large rigs, to measure and to watch.

use cage_rig::coordinates::KINDS;
use cage_rig::skinning::METHODS;
use cage_rig::sync::{BindInput, BindOptions, Known};
use cage_rig::{Cage, Point, Polygons, Skeleton, SkinWeights};
use std::f64::consts::TAU;

/// A bumpy tube along x of `rings` by `around` vertices, four of `joints` bones a vertex, in a square cage of
/// `cage_rings`; for a method with centers of rotation.
pub fn snake(rings: usize, around: usize, joints: usize, cage_rings: usize) -> BindInput {
    let last = (joints - 1) as f64;
    let count = rings * around;
    let (mut skin, mut starts, mut indices, mut data) = (Vec::new(), vec![0], Vec::new(), Vec::new());
    for i in 0..count {
        let x = (i / around) as f64 / rings as f64 * last;
        let turn = (i % around) as f64 / around as f64 * TAU;
        let radius = 0.8 + 0.2 * (3.0 * x).sin();
        skin.push(Point::new(x, radius * turn.cos(), radius * turn.sin()));
        let place = x + 0.15 * turn.cos() + 0.1 * (2.0 * turn + x).sin();
        let first = (place.floor() as i64 - 1).clamp(0, joints as i64 - 4);
        for j in first..first + 4 {
            indices.push(j);
            data.push((-1.5 * (place - j as f64).powi(2)).exp() + 1e-4);
        }
        starts.push(data.len() as i64);
    }
    let next = |i: usize| i - i % around + (i + 1) % around;
    let quads = (0..count - around).map(|i| [i, next(i), next(i) + around, i + around]);
    let corners: Vec<i64> = quads.flatten().map(|v| v as i64).collect();
    let step = (last + 1.4) / (cage_rings - 1) as f64;
    let tube: Vec<(f64, f64)> = (0..cage_rings).map(|k| (-0.7 + step * k as f64, 1.1)).collect();
    let (cage, cage_faces) = super::shapes::square_tube(&tube);
    let parents: Vec<i64> = (0..joints as i64).map(|j| j - 1).collect();
    let places = (0..joints).map(|j| Point::new(j as f64, 0.0, 0.0)).collect();
    BindInput {
        skin_vertices: skin,
        skin_faces: Polygons { sizes: vec![4; corners.len() / 4], corners },
        skin_weights: SkinWeights::from_compressed(joints, &starts, &indices, &data).expect("valid weights"),
        skeleton: Skeleton::new(places, &parents).expect("a chain"),
        cage: Cage::new(cage, &cage_faces).expect("a tube"),
        method: METHODS.iter().find(|method| method.centers).expect("one has centers"),
        coordinates: &KINDS[0],
        known: Known::default(),
        options: BindOptions::default(),
    }
}
