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

mod bake_frames;
pub mod bind;
pub mod cage_reverser;
pub mod cage_updater;
mod drag;
mod frame;
mod ground;
pub mod joint_coordinates;
mod low_rank;
pub mod max_entropy;
pub mod maxvol;
mod passes;
pub mod reach;
pub mod rest_centers;
pub mod rest_skin;
mod reverse;
mod shapes;
pub mod skeleton_updater;
pub mod stages;
mod work;

#[cfg(test)]
mod frame_tests;
#[cfg(test)]
mod naive;
#[cfg(test)]
mod shape_tests;
#[cfg(test)]
mod tests;

pub use bake_frames::Frame;
pub use bind::{BindInput, BindOptions, Binding, Known, Report};
pub use ground::Carried;
pub use work::Work;

use crate::cage::Cage;
use crate::error::{CageError, Error, PoseError, SkinError};
use crate::panels::Precision;
use crate::points::{first_unusable, Matrix3, Point, Transform};
use crate::progress::{unwatched, Cancelled, Part, Progress};
use crate::rows::Rows;
use crate::skinning::SkinningMethod;
use cage_reverser::CageReverser;
use frame::Buffers;
use ground::Ground;
use rest_centers::RestCenters;
use skeleton_updater::JointMotion;
use stages::Stages;
use std::sync::Arc;
use work::Stale;

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
    reproducible: bool,
    centers: Option<RestCenters>,
    rest_cage: Vec<Point>,
    motions: Vec<JointMotion>,
    ground: Ground,
    joints: Vec<Point>,
    transforms: Vec<Transform>,
    rest_skin: Vec<[f32; 3]>,
    posed_skin: Vec<[f32; 3]>,
    posed_cage: Vec<Point>,
    buffers: Buffers,
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
        let rest = binding.rest_skin.at_bind();
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
            buffers: Buffers::new(binding.cage.vertices()),
            stale: Stale::default(),
            reverser: None,
            work: Work { anchor_factorisations: 1, ..Work::default() },
            method,
            reproducible: false,
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
        self.read_motions(transforms, rest_joints)?;
        self.propagate(None, true);
        Ok(())
    }

    /// The artist moves the rest cage to `cage` (`#C by 3`).
    pub fn edit_rest_cage(&mut self, cage: &[Point]) -> Result<(), PoseError> {
        self.check_cage(cage)?;
        self.propagate(Some(cage), false);
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
        self.propagate(Some(&cage), false);
        // The artist's own numbers, which the fit repeats to rounding.
        self.posed_cage.copy_from_slice(wanted);
        self.stale.posed_cage = false;
        Ok(())
    }

    /// Playback: rest cage and bones together, as [`Self::edit_rest_cage`] and [`Self::pose`].
    /// Returns whether anything of it was new.
    pub fn play(
        &mut self,
        cage: &[Point],
        transforms: &[Transform],
        rest_joints: Option<&[Point]>,
    ) -> Result<bool, PoseError> {
        self.check_cage(cage)?;
        self.read_motions(transforms, rest_joints)?;
        Ok(self.propagate(Some(cage), true))
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
            self.buffers.kept.forget();
            self.centers.iter_mut().for_each(RestCenters::forget);
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

    /// How frames keep Φ and Λ from now on. Nothing else depends on it: anchors, cages and joints stay.
    pub fn set_precision(&mut self, precision: Precision) {
        if precision != self.precision() {
            Arc::make_mut(&mut self.binding).repack(precision);
            self.centers.iter_mut().for_each(|centers| centers.repack(precision));
            self.buffers.kept.forget();
            self.rest_skin_changed();
        }
    }

    /// Whether frames are to be the same bit for bit whatever was played and edited before them, as files need them,
    /// or as fast as can be: what was before saves most of the product with Φ, and is good to rounding.
    pub fn set_reproducible(&mut self, reproducible: bool) {
        if reproducible != self.reproducible {
            self.reproducible = reproducible;
            self.buffers.kept.set_whole(reproducible);
            self.centers.iter_mut().for_each(|centers| centers.set_reproducible(reproducible));
            self.rest_skin_changed();
        }
    }

    /// Whether frames are the same whatever was before them.
    pub fn is_reproducible(&self) -> bool {
        self.reproducible
    }

    /// How frames keep Φ and Λ.
    pub fn precision(&self) -> Precision {
        self.binding.rest_skin.precision()
    }

    /// The centers of rotation, where `method` is the first that needs them and they were not given.
    /// They can be integrated beside the rig, which goes on meanwhile with the method that it has.
    pub fn due_centers(&self, method: &SkinningMethod) -> Option<DueCenters> {
        (method.centers && self.centers.is_none()).then(|| DueCenters(Arc::clone(&self.binding)))
    }

    /// Takes what [`Self::due_centers`] gave, integrated.
    pub fn take_centers(&mut self, mut centers: RestCenters) {
        if self.centers.is_none() {
            // It may have changed since they were due.
            centers.repack(self.precision());
            if self.reproducible {
                centers.set_reproducible(true);
            }
            self.centers = Some(centers);
            self.work.center_integrations += 1;
        }
    }

    /// How bones move the visible skin.
    pub fn method(&self) -> &'static SkinningMethod {
        self.method
    }

    /// The only place that knows what follows from what. `motions`: those just read count. What is
    /// given and equal to what is there changes nothing; returns whether anything changed.
    fn propagate(&mut self, cage: Option<&[Point]>, motions: bool) -> bool {
        let cage = cage.filter(|cage| *cage != self.rest_cage.as_slice());
        let motions = motions && self.buffers.motions != self.motions;
        if cage.is_none() && !motions {
            return false;
        }
        if let Some(cage) = cage {
            self.rest_cage.copy_from_slice(cage);
            self.rest_skin_changed();
        }
        if motions {
            std::mem::swap(&mut self.buffers.motions, &mut self.motions);
            // Eq. (19) depends on the linear parts alone.
            let turned = |(new, old): (&JointMotion, &JointMotion)| new.linear != old.linear;
            if self.motions.iter().zip(&self.buffers.motions).any(turned) {
                self.reverser = None;
            }
        }
        self.refit();
        true
    }

    fn rest_skin_changed(&mut self) {
        self.stale.rest_skin = true;
        self.stale.posed_skin = true;
        self.centers.iter_mut().for_each(RestCenters::invalidate);
    }

    /// Joints and transforms anew, and all that is posed by them.
    fn refit(&mut self) {
        self.ground.joints_into(&self.binding, &self.rest_cage, &mut self.joints);
        self.binding.skeleton_updater.transforms_into(&self.motions, &self.joints, &mut self.transforms);
        self.stale.posed_skin = true;
        self.stale.posed_cage = true;
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

    fn check_transforms(
        &self,
        transforms: &[Transform],
        rest_joints: Option<&[Point]>,
    ) -> Result<(), PoseError> {
        if transforms.len() != self.joints.len() {
            return Err(PoseError::TransformCount { expected: self.joints.len(), found: transforms.len() });
        }
        if let Some(joint) = transforms.iter().position(|t| !t.is_usable()) {
            return Err(PoseError::TransformNotFinite { joint });
        }
        rest_joints.map_or(Ok(()), |joints| self.check_joints(joints))
    }

    /// Reads the animation's R_j and d_j into the buffer for them.
    fn read_motions(
        &mut self,
        transforms: &[Transform],
        rest_joints: Option<&[Point]>,
    ) -> Result<(), PoseError> {
        self.check_transforms(transforms, rest_joints)?;
        let updater = &self.binding.skeleton_updater;
        let rest_joints = rest_joints.unwrap_or(updater.skeleton().joints());
        updater.motions_into(transforms, rest_joints, &mut self.buffers.motions);
        Ok(())
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
