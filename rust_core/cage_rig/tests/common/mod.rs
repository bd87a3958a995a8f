//! Rigs for tests: made in code, and the reference rig of [CTL*20] where its files are at hand.
#![allow(dead_code)] // every test crate uses a part

pub mod arm;
pub mod large;
pub mod random;
pub mod shapes;

use cage_rig::sync::{BindInput, BindOptions, CoupledRig, Known};
use cage_rig::{Cage, Matrix3, Point, Polygons, Rows, Skeleton, SkinWeights, Transform};

/// A rig before it is bound.
#[derive(Debug, Clone)]
pub struct Fixture {
    pub name: &'static str,
    pub skin: Vec<Point>,
    pub skin_faces: Polygons,
    /// `#M by #J`, not normalised.
    pub weights: Rows,
    pub joints: Vec<Point>,
    pub parents: Vec<i64>,
    pub cage: Vec<Point>,
    pub cage_faces: Polygons,
}

impl Fixture {
    pub fn cage(&self) -> Cage {
        Cage::new(self.cage.clone(), &self.cage_faces).expect("the fixture's cage is closed")
    }

    pub fn input(&self) -> BindInput {
        BindInput {
            skin_vertices: self.skin.clone(),
            skin_faces: self.skin_faces.clone(),
            skin_weights: SkinWeights::from_dense(&self.weights).expect("the fixture's weights are valid"),
            skeleton: Skeleton::new(self.joints.clone(), &self.parents)
                .expect("the fixture's skeleton is valid"),
            cage: self.cage(),
            method: cage_rig::skinning::method("lbs").expect("linear blending is always there"),
            coordinates: cage_rig::coordinates::kind("mean_value").expect("mean value is always there"),
            known: Known::default(),
            options: BindOptions::default(),
        }
    }

    pub fn rig(&self) -> CoupledRig {
        CoupledRig::new(self.input()).expect("the fixture binds")
    }

    pub fn size(&self) -> f64 {
        cage_rig::bounding_diagonal(&self.skin)
    }
}

/// Every fixture of the project's own whose cage encloses the whole skin.
pub fn all() -> Vec<Fixture> {
    vec![shapes::bar(), shapes::blob(), shapes::more_cage_than_skin(), shapes::far_vertex()]
}

/// Rotation about `axis` by `angle` that keeps `pivot` in place.
pub fn turn(pivot: Point, axis: Point, angle: f64) -> Transform {
    let linear = rotation(axis, angle);
    Transform { linear, translation: pivot - linear * pivot }
}

/// Rodrigues' formula.
pub fn rotation(axis: Point, angle: f64) -> Matrix3 {
    let k = axis.normalize().cross_matrix();
    Matrix3::identity() + k * angle.sin() + k * k * (1.0 - angle.cos())
}

/// `outer` after `inner`.
pub fn compose(outer: &Transform, inner: &Transform) -> Transform {
    Transform { linear: outer.linear * inner.linear, translation: outer.apply(&inner.translation) }
}

/// `outer` after each of `inner`.
pub fn compose_all(outer: &Transform, inner: &[Transform]) -> Vec<Transform> {
    inner.iter().map(|inner| compose(outer, inner)).collect()
}

/// Transforms of the whole skeleton from one local transform per joint (measured at rest places).
pub fn forward(fixture: &Fixture, local: &[Transform]) -> Vec<Transform> {
    let skeleton =
        Skeleton::new(fixture.joints.clone(), &fixture.parents).expect("the fixture's skeleton is valid");
    let mut global = local.to_vec();
    for &j in skeleton.parents_first() {
        if let Some(parent) = skeleton.parent(j) {
            global[j] = compose(&global[parent], &local[j]);
        }
    }
    global
}

/// A pose that bends every joint, moves the roots and stretches some bones.
pub fn lively_pose(fixture: &Fixture, amount: f64) -> Vec<Transform> {
    let local: Vec<Transform> = (0..fixture.joints.len())
        .map(|j| {
            let phase = 1.0 + j as f64;
            let axis = Point::new(phase.sin(), (2.0 * phase).cos(), (0.7 * phase).sin() + 0.1);
            let mut local = turn(fixture.joints[j], axis, amount * (0.3 + 0.5 * phase.cos().abs()));
            if j % 3 == 1 {
                let stretched = local.linear * (1.0 + 0.2 * amount);
                local.translation += (local.linear - stretched) * fixture.joints[j];
                local.linear = stretched;
            }
            local.translation += axis * (0.05 * amount * fixture.size());
            local
        })
        .collect();
    forward(fixture, &local)
}

/// The largest distance between two lists of points.
pub fn distance(a: &[Point], b: &[Point]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
}

/// Frame numbers as points.
pub fn points(frame: &[[f32; 3]]) -> Vec<Point> {
    frame.iter().map(|p| Point::new(p[0].into(), p[1].into(), p[2].into())).collect()
}

/// `cage` with every vertex moved by up to `amount`.
pub fn nudged(cage: &[Point], amount: f64, seed: u64) -> Vec<Point> {
    let mut random = random::Random::new(seed);
    cage.iter().map(|c| c + random.point() * amount).collect()
}
