//! [`CoupledRig`]: the only owner of the cycle between cage and skeleton.
//!
//! Six structures (rest and posed skin, skeleton, cage) and four edits. An edit changes the rest
//! cage C, or what the animation says of the bones, or both; everything else follows:
//!
//! ```text
//! rest changed ─► joints a = Ψ C (13)          always ─► transforms T (16–17)
//!                 rest skin M = M₀ + Φ(C − C₀) (7)       posed skin M′ = F(T, Ω, M) (1–3)
//!                                                        posed cage C′ (8)
//! ```
//!
//! Joints and transforms follow at once. The three large arrays are remade when they are read, so
//! that a frame pays for what it shows: `Stale` is the one place that knows which are due.

pub mod bind;
pub mod cage_reverser;
pub mod cage_updater;
mod ground;
pub mod joint_coordinates;
pub mod max_entropy;
pub mod maxvol;
pub mod reach;
pub mod rest_centers;
pub mod rest_skin;
pub mod skeleton_updater;
pub mod stages;
mod work;

#[cfg(test)]
mod naive;
#[cfg(test)]
mod tests;

pub use bind::{BindInput, BindOptions, Binding, Known, Report};
pub use ground::Carried;
pub use work::Work;

use crate::cage::Cage;
use crate::error::{CageError, Error, PoseError, SkinError};
use crate::points::{bounding_diagonal, first_unusable, Matrix3, Point, Transform};
use crate::progress::{unwatched, Cancelled, Part, Progress};
use crate::rows::Rows;
use crate::skinning::{SkinningInput, SkinningMethod};
use cage_reverser::CageReverser;
use ground::Ground;
use rest_centers::RestCenters;
use skeleton_updater::JointMotion;
use stages::Stages;
use std::sync::Arc;
use work::Stale;

/// A posed cage edit has arrived when it misses by this part of the size.
const ARRIVED: f64 = 1e-12;
/// An edit that ends farther away than this is refused.
const REACHED: f64 = 1e-10;
/// Solves an edit may take: one, and refinements where Eq. (19) is badly conditioned.
const SOLVES: usize = 4;

/// Centers of rotation that a rig has not needed yet. Knows all that they depend on.
#[derive(Debug, Clone)]
pub struct DueCenters(Arc<Binding>);

impl DueCenters {
    /// Integrates them, for [`CoupledRig::take_centers`].
    pub fn integrate(&self, part: &Part) -> Result<RestCenters, Cancelled> {
        self.0.integrate_centers(part)
    }
}

/// A character bound to a cage and a skeleton. Rig space throughout.
#[derive(Debug, Clone)]
pub struct CoupledRig {
    binding: Arc<Binding>,
    method: &'static SkinningMethod,
    centers: Option<RestCenters>,
    rest_cage: Vec<Point>,
    motions: Vec<JointMotion>,
    ground: Ground,
    joints: Vec<Point>,
    transforms: Vec<Transform>,
    rest_skin: Vec<[f32; 3]>,
    posed_skin: Vec<[f32; 3]>,
    posed_cage: Vec<Point>,
    stale: Stale,
    reverser: Option<CageReverser>,
    work: Work,
}

impl CoupledRig {
    /// Binds: everything is precomputed here.
    pub fn new(input: BindInput) -> Result<Self, Error> {
        Self::bind(input, &Progress::default())
    }

    /// Binds, telling its progress. Cancelled it stops within some 50 ms, a little more where a cage
    /// has hundreds of vertices: decompositions of `#C by #C` matrices can't be interrupted.
    pub fn bind(input: BindInput, progress: &Progress) -> Result<Self, Error> {
        let (method, stages) = (input.method, Stages::new(&input, progress));
        let mut binding = Binding::new(input, &stages)?;
        let ground = Ground::new(&binding, &stages.surroundings)?;
        let centers = match binding.center_coords.take() {
            Some(coords) => Some(binding.given_centers(coords, &stages.centers)?),
            None => None,
        };
        let joints = ground.joints(&binding, binding.cage.vertices());
        let rest = binding.rest_skin.at_bind().to_vec();
        let mut rig = Self {
            centers,
            rest_cage: binding.cage.vertices().to_vec(),
            motions: vec![JointMotion { linear: Matrix3::identity(), step: Point::zeros() }; joints.len()],
            ground,
            transforms: vec![Transform::identity(); joints.len()],
            joints,
            posed_skin: rest.clone(),
            rest_skin: rest,
            posed_cage: binding.cage.vertices().to_vec(),
            stale: Stale::default(),
            reverser: None,
            work: Work { anchor_factorisations: 1, ..Work::default() },
            method,
            binding: Arc::new(binding),
        };
        if let Some(due) = rig.due_centers(method) {
            rig.take_centers(due.integrate(&stages.centers)?);
        }
        stages.end()?;
        Ok(rig)
    }

    /// The bones move: `transforms` (one per joint) as the animation measures them at
    /// `rest_joints` (`#J by 3`; the joints of the bind if not given).
    pub fn pose(&mut self, transforms: &[Transform], rest_joints: Option<&[Point]>) -> Result<(), PoseError> {
        let motions = self.read_motions(transforms, rest_joints)?;
        self.propagate(None, Some(motions));
        Ok(())
    }

    /// The artist moves the rest cage to `cage` (`#C by 3`).
    pub fn edit_rest_cage(&mut self, cage: &[Point]) -> Result<(), PoseError> {
        self.check_cage(cage)?;
        self.propagate(Some(cage), None);
        Ok(())
    }

    /// The artist moves the posed cage to `wanted` (`#C by 3`): CageRev finds the rest cage that
    /// is posed so, Eq. (19).
    pub fn edit_posed_cage(&mut self, wanted: &[Point]) -> Result<(), PoseError> {
        self.check_cage(wanted)?;
        if self.posed_cage() == wanted {
            return Ok(());
        }
        let cage = self.reverse(wanted)?;
        self.propagate(Some(&cage), None);
        // The artist's own numbers, which the fit repeats to rounding.
        self.posed_cage.copy_from_slice(wanted);
        self.stale.posed_cage = false;
        Ok(())
    }

    /// Playback: rest cage and bones together, as [`Self::edit_rest_cage`] and [`Self::pose`].
    pub fn play(
        &mut self,
        cage: &[Point],
        transforms: &[Transform],
        rest_joints: Option<&[Point]>,
    ) -> Result<(), PoseError> {
        self.check_cage(cage)?;
        let motions = self.read_motions(transforms, rest_joints)?;
        self.propagate(Some(cage), Some(motions));
        Ok(())
    }

    /// Moves the visible skin at rest by `offsets` (`#M by 3`; shape keys of a face). Anchors and
    /// cages do not see them.
    pub fn offset_rest_skin(&mut self, offsets: Option<&[Point]>) -> Result<(), SkinError> {
        if let Some(offsets) = offsets {
            if offsets.len() != self.rest_skin.len() {
                return Err(SkinError::OffsetCount { expected: self.rest_skin.len(), found: offsets.len() });
            }
            if let Some(row) = first_unusable(offsets) {
                return Err(SkinError::OffsetNotFinite { row });
            }
        }
        if self.ground.set_offsets(offsets) {
            self.rest_skin_changed();
        }
        Ok(())
    }

    /// Confines the cage to `mask` (`#M`, 0 to 1; none: wherever it reaches): a vertex, and a joint
    /// by the skin around it, takes part in the cage's movement by so much. The posed cage stays the
    /// whole one.
    pub fn mask_skin(&mut self, mask: Option<&[f32]>) -> Result<(), SkinError> {
        if let Some(mask) = mask {
            if mask.len() != self.rest_skin.len() {
                return Err(SkinError::MaskCount { expected: self.rest_skin.len(), found: mask.len() });
            }
            if let Some(row) = mask.iter().position(|part| !(0.0..=1.0).contains(part)) {
                return Err(SkinError::MaskRange { row, found: mask[row] });
            }
        }
        if self.ground.set_mask(&self.binding, mask) {
            self.reverser = None;
            self.rest_skin_changed();
            self.refit();
        }
        Ok(())
    }

    /// Stands the rig on what a lower cage on the same character has done to its rest cage and
    /// joints (none: nothing). What it does to the skin is among [`Self::offset_rest_skin`].
    pub fn carry(&mut self, carried: Option<Carried>) -> Result<(), PoseError> {
        if let Some(Carried { cage, joints }) = &carried {
            self.check_cage(cage)?;
            self.check_joints(joints)?;
        }
        if self.ground.set_carried(carried) {
            self.refit();
        }
        Ok(())
    }

    /// How bones move the visible skin from now on. Nothing else depends on it: cages, joints and
    /// transforms stay as they are. Integrates the centers of rotation where they are due.
    pub fn set_method(&mut self, method: &'static SkinningMethod) {
        if let Some(due) = self.due_centers(method) {
            self.take_centers(unwatched(|part| due.integrate(part)));
        }
        if method.number != self.method.number {
            self.method = method;
            self.stale.posed_skin = true;
        }
    }

    /// The centers of rotation, where `method` is the first that needs them and they were not given.
    /// They can be integrated beside the rig, which goes on meanwhile with the method that it has.
    pub fn due_centers(&self, method: &SkinningMethod) -> Option<DueCenters> {
        (method.centers && self.centers.is_none()).then(|| DueCenters(Arc::clone(&self.binding)))
    }

    /// Takes what [`Self::due_centers`] gave, integrated.
    pub fn take_centers(&mut self, centers: RestCenters) {
        if self.centers.is_none() {
            self.centers = Some(centers);
            self.work.center_integrations += 1;
        }
    }

    /// How bones move the visible skin.
    pub fn method(&self) -> &'static SkinningMethod {
        self.method
    }

    /// The only place that knows what follows from what. What is given and equal to what is there
    /// changes nothing.
    fn propagate(&mut self, cage: Option<&[Point]>, motions: Option<Vec<JointMotion>>) {
        let cage = cage.filter(|cage| *cage != self.rest_cage.as_slice());
        let motions = motions.filter(|motions| *motions != self.motions);
        if cage.is_none() && motions.is_none() {
            return;
        }
        if let Some(cage) = cage {
            self.rest_cage.copy_from_slice(cage);
            self.rest_skin_changed();
        }
        if let Some(motions) = motions {
            // Eq. (19) depends on the linear parts alone.
            let turned = motions.iter().zip(&self.motions).any(|(new, old)| new.linear != old.linear);
            self.reverser = self.reverser.take().filter(|_| !turned);
            self.motions = motions;
        }
        self.refit();
    }

    fn rest_skin_changed(&mut self) {
        self.stale.rest_skin = true;
        self.stale.posed_skin = true;
        self.centers.iter_mut().for_each(RestCenters::invalidate);
    }

    /// Joints and transforms anew, and all that is posed by them.
    fn refit(&mut self) {
        self.joints = self.ground.joints(&self.binding, &self.rest_cage);
        self.transforms = self.binding.skeleton_updater.transforms(&self.motions, &self.joints);
        self.stale.posed_skin = true;
        self.stale.posed_cage = true;
    }

    /// The rest cage whose posed cage is `wanted`. Changes nothing but the kept factors.
    fn reverse(&mut self, wanted: &[Point]) -> Result<Vec<Point>, PoseError> {
        let reverser = match self.reverser.take() {
            Some(reverser) => reverser,
            None => {
                self.work.reverse_factorisations += 1;
                let linear: Vec<Matrix3> = self.motions.iter().map(|m| m.linear).collect();
                let Binding { cage_updater, skeleton_updater, .. } = &*self.binding;
                CageReverser::new(cage_updater, skeleton_updater, &linear, self.ground.shares())?
            }
        };
        let mut cage = self.rest_cage.clone();
        let mut reached = self.posed_cage.clone();
        let mut miss = f64::INFINITY;
        for _ in 0..SOLVES {
            let step: Vec<Point> = wanted.iter().zip(&reached).map(|(w, r)| w - r).collect();
            let change = reverser.solve(&step);
            let next: Vec<Point> = cage.iter().zip(&change).map(|(c, d)| c + d).collect();
            let joints = self.ground.joints(&self.binding, &next);
            let transforms = self.binding.skeleton_updater.transforms(&self.motions, &joints);
            let posed = self.binding.cage_updater.posed_cage(&self.ground.cage(&next), &transforms);
            self.work.reverse_solves += 1;
            self.work.cage_fits += 1;
            let next_miss =
                largest_distance(&posed, wanted) / bounding_diagonal(self.binding.cage.vertices());
            if next_miss.is_nan() || next_miss >= 0.5 * miss {
                break;
            }
            (cage, reached, miss) = (next, posed, next_miss);
            if miss <= ARRIVED {
                break;
            }
        }
        self.reverser = Some(reverser);
        if miss <= REACHED {
            Ok(cage)
        } else {
            Err(PoseError::Unreachable { miss })
        }
    }

    fn check_cage(&self, cage: &[Point]) -> Result<(), PoseError> {
        if cage.len() != self.rest_cage.len() {
            return Err(PoseError::CageCount { expected: self.rest_cage.len(), found: cage.len() });
        }
        first_unusable(cage).map_or(Ok(()), |vertex| Err(PoseError::CageNotFinite { vertex }))
    }

    fn check_joints(&self, joints: &[Point]) -> Result<(), PoseError> {
        if joints.len() != self.joints.len() {
            return Err(PoseError::JointCount { expected: self.joints.len(), found: joints.len() });
        }
        first_unusable(joints).map_or(Ok(()), |joint| Err(PoseError::JointNotFinite { joint }))
    }

    fn read_motions(
        &self,
        transforms: &[Transform],
        rest_joints: Option<&[Point]>,
    ) -> Result<Vec<JointMotion>, PoseError> {
        let skeleton = self.binding.skeleton_updater.skeleton();
        let rest_joints = rest_joints.unwrap_or(skeleton.joints());
        if transforms.len() != skeleton.len() {
            return Err(PoseError::TransformCount { expected: skeleton.len(), found: transforms.len() });
        }
        if let Some(joint) = transforms.iter().position(|t| !t.is_usable()) {
            return Err(PoseError::TransformNotFinite { joint });
        }
        self.check_joints(rest_joints)?;
        Ok(self.binding.skeleton_updater.motions(transforms, rest_joints))
    }

    /// Rest skin M, `#M by 3`.
    pub fn rest_skin(&mut self) -> &[[f32; 3]] {
        if self.stale.rest_skin {
            let (mask, offsets) = (self.ground.mask(), self.ground.offsets());
            self.binding.rest_skin.write(&self.rest_cage, mask, offsets, &mut self.rest_skin);
            self.work.rest_passes += 1;
            self.stale.rest_skin = false;
        }
        &self.rest_skin
    }

    /// Posed skin M′, `#M by 3`.
    pub fn posed_skin(&mut self) -> &[[f32; 3]] {
        self.rest_skin();
        if self.stale.posed_skin {
            let needed = self.centers.as_mut().filter(|_| self.method.centers);
            let centers = needed.map_or(&[][..], |centers| {
                let (mask, offsets) = (self.ground.mask(), self.ground.offsets());
                self.work.center_passes += usize::from(centers.update(&self.rest_cage, mask, offsets));
                centers.centers()
            });
            let (transforms, weights) = (&self.transforms, &self.binding.packed_weights);
            let input = SkinningInput { transforms, weights, rest_skin: &self.rest_skin, centers };
            (self.method.pose)(&input, &mut self.posed_skin);
            self.work.skin_passes += 1;
            self.stale.posed_skin = false;
        }
        &self.posed_skin
    }

    /// Posed cage C′, `#C by 3`.
    pub fn posed_cage(&mut self) -> &[Point] {
        if self.stale.posed_cage {
            let cage = self.ground.cage(&self.rest_cage);
            self.posed_cage = self.binding.cage_updater.posed_cage(&cage, &self.transforms);
            self.work.cage_fits += 1;
            self.stale.posed_cage = false;
        }
        &self.posed_cage
    }

    /// Rest cage C, `#C by 3`.
    pub fn rest_cage(&self) -> &[Point] {
        &self.rest_cage
    }

    /// Rest joints a, `#J by 3`.
    pub fn joints(&self) -> &[Point] {
        &self.joints
    }

    /// Transforms T′ of the refit skeleton, one per joint.
    pub fn transforms(&self) -> &[Transform] {
        &self.transforms
    }

    /// Posed joints T′_j(a_j), `#J by 3`.
    pub fn posed_joints(&self) -> Vec<Point> {
        self.transforms.iter().zip(&self.joints).map(|(t, a)| t.apply(a)).collect()
    }

    /// Φ, `#M by #C`.
    pub fn cage_coords(&self) -> &Rows {
        &self.binding.cage_coords
    }

    /// How much the cage vertices `vertices` move each skin vertex together, `#M`: the sum of their
    /// columns of Φ, where the cage reaches and its mask lets it. Wrong vertices: an error.
    pub fn cage_influence(&self, vertices: &[i64]) -> Result<Vec<f32>, CageError> {
        let columns = self.binding.cage.vertices().len();
        let mut chosen = Vec::with_capacity(vertices.len());
        for &vertex in vertices {
            match usize::try_from(vertex).ok().filter(|v| *v < columns) {
                Some(vertex) => chosen.push(vertex),
                None => return Err(CageError::NoSuchVertex { vertex, vertices: columns }),
            }
        }
        let (coords, mask) = (&self.binding.cage_coords, self.ground.mask());
        let part = |i: usize| mask.map_or(1.0, |mask| f64::from(mask[i]));
        let sum = |i: usize| chosen.iter().map(|&c| coords.row(i)[c]).sum::<f64>();
        Ok((0..coords.len()).map(|i| (part(i) * sum(i)) as f32).collect())
    }

    /// Ψ, `#J by #C`.
    pub fn joint_coords(&self) -> &Rows {
        self.binding.skeleton_updater.joint_coords()
    }

    /// Λ, `#M by #C`: given to the bind, or since a method first needed it.
    pub fn center_coords(&self) -> Option<&Rows> {
        self.centers.as_ref().map(RestCenters::coords)
    }

    /// Anchor skin vertices, min(`#M`, `#C`).
    pub fn anchors(&self) -> &[usize] {
        &self.binding.anchors
    }

    /// The cage of the bind.
    pub fn cage(&self) -> &Cage {
        &self.binding.cage
    }

    /// What the bind found.
    pub fn report(&self) -> &Report {
        &self.binding.report
    }

    /// Bounding-box diagonal of the skin at bind.
    pub fn size(&self) -> f64 {
        self.binding.size
    }

    /// What was done since the bind.
    pub fn work(&self) -> Work {
        self.work
    }
}

fn largest_distance(a: &[Point], b: &[Point]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
}
