//! `CoupledRig` for Python. The rig lives behind a lock that a panic poisons: after one, every
//! call is refused instead of working on what the panic left behind.

use crate::arrays::{self, Out};
use crate::bones::Bones;
use crate::errors::{CageRigError, OrRaise};
use crate::input::{precision, read_input, Given, Meshes};
use crate::jobs::MethodJob;
use cage_rig::sync::rest_centers::RestCenters;
use cage_rig::sync::{Carried, Frame};
use cage_rig::{Point, Precision};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex};

/// A character bound to a cage and a skeleton.
#[pyclass(frozen, module = "cage_rig_core")]
#[derive(Clone)]
pub(crate) struct CoupledRig {
    rig: Arc<Mutex<cage_rig::CoupledRig>>,
    pub(crate) joints: usize,
    pub(crate) cage_vertices: usize,
    pub(crate) skin_vertices: usize,
}

impl CoupledRig {
    /// Puts a bound rig behind its lock.
    pub(crate) fn of(rig: cage_rig::CoupledRig) -> Self {
        let (joints, cage_vertices) = (rig.joints().len(), rig.rest_cage().len());
        let skin_vertices = rig.cage_coords().len();
        Self { rig: Arc::new(Mutex::new(rig)), joints, cage_vertices, skin_vertices }
    }

    /// Takes its centers of rotation; a rig that is unusable needs none.
    pub(crate) fn take_centers(&self, centers: RestCenters) {
        if let Ok(mut rig) = self.rig.lock() {
            rig.take_centers(centers);
        }
    }

    /// Runs `work` on the rig without the GIL.
    pub(crate) fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut cage_rig::CoupledRig) -> R + Send,
    ) -> PyResult<R> {
        py.detach(|| self.rig.lock().map(|mut rig| work(&mut rig)).map_err(|_| ()))
            .map_err(|()| CageRigError::new_err("an internal error has left this rig unusable; bind again"))
    }

    fn cage(&self, cage: &Bound<'_, PyAny>) -> PyResult<Vec<Point>> {
        arrays::points(cage, "cage", ("#C", Some(self.cage_vertices)))
    }

    fn rest_joints(&self, joints: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<Point>>> {
        joints.map(|joints| arrays::points(joints, "rest_joints", ("#J", Some(self.joints)))).transpose()
    }
}

#[pymethods]
impl CoupledRig {
    #[new]
    #[pyo3(signature = (skin_vertices, skin_faces, skin_weights, joints, parents, cage_vertices, cage_faces, *,
        method="lbs", coordinates="mean_value", anchors=None, cage_coords=None, joint_coords=None,
        center_coords=None, options=None))]
    #[allow(clippy::too_many_arguments)] // the public signature: keyword-only but for the three meshes
    fn new(
        py: Python<'_>,
        skin_vertices: &Bound<'_, PyAny>,
        skin_faces: &Bound<'_, PyAny>,
        skin_weights: &Bound<'_, PyAny>,
        joints: &Bound<'_, PyAny>,
        parents: &Bound<'_, PyAny>,
        cage_vertices: &Bound<'_, PyAny>,
        cage_faces: &Bound<'_, PyAny>,
        method: &str,
        coordinates: &str,
        anchors: Option<&Bound<'_, PyAny>>,
        cage_coords: Option<&Bound<'_, PyAny>>,
        joint_coords: Option<&Bound<'_, PyAny>>,
        center_coords: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let meshes =
            Meshes { skin_vertices, skin_faces, skin_weights, joints, parents, cage_vertices, cage_faces };
        let given = Given { anchors, cage_coords, joint_coords, center_coords };
        let input = read_input(py, &meshes, &given, (method, coordinates), options)?;
        py.detach(|| cage_rig::CoupledRig::new(input)).map(Self::of).or_raise()
    }

    /// The bones move: transforms (#J, 4, 4) measured at rest_joints (default: those of the bind).
    #[pyo3(signature = (transforms, rest_joints=None))]
    fn pose(
        &self,
        py: Python<'_>,
        transforms: &Bound<'_, PyAny>,
        rest_joints: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let transforms = arrays::transforms(transforms, self.joints)?;
        let rest_joints = self.rest_joints(rest_joints)?;
        self.with(py, |rig| rig.pose(&transforms, rest_joints.as_deref()))?.or_raise()
    }

    /// The artist moves the rest cage to cage (#C, 3).
    fn edit_rest_cage(&self, py: Python<'_>, cage: &Bound<'_, PyAny>) -> PyResult<()> {
        let cage = self.cage(cage)?;
        self.with(py, |rig| rig.edit_rest_cage(&cage))?.or_raise()
    }

    /// The artist moves the posed cage to cage (#C, 3): the rest cage follows.
    fn edit_posed_cage(&self, py: Python<'_>, cage: &Bound<'_, PyAny>) -> PyResult<()> {
        let cage = self.cage(cage)?;
        self.with(py, |rig| rig.edit_posed_cage(&cage))?.or_raise()
    }

    /// Playback: rest cage and transforms together. Whether anything of it was new.
    #[pyo3(signature = (cage, transforms, rest_joints=None))]
    fn play(
        &self,
        py: Python<'_>,
        cage: &Bound<'_, PyAny>,
        transforms: &Bound<'_, PyAny>,
        rest_joints: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<bool> {
        let cage = self.cage(cage)?;
        let transforms = arrays::transforms(transforms, self.joints)?;
        let rest_joints = self.rest_joints(rest_joints)?;
        self.with(py, |rig| rig.play(&cage, &transforms, rest_joints.as_deref()))?.or_raise()
    }

    /// Playback where bones are posed (#J, 4, 4). Whether anything of it was new.
    fn play_posed(
        &self,
        py: Python<'_>,
        cage: &Bound<'_, PyAny>,
        bones: &Bones,
        posed: &Bound<'_, PyAny>,
    ) -> PyResult<bool> {
        bones.check(self.joints)?;
        let cage = self.cage(cage)?;
        let posed = arrays::matrices(posed, "posed", Some(self.joints))?;
        let bones = &bones.bones;
        self.with(py, |rig| rig.play(&cage, &bones.transforms(&posed), Some(&bones.heads())))?.or_raise()
    }

    /// Moves the visible skin at rest by offsets (#M, 3), or not at all (None).
    #[pyo3(signature = (offsets))]
    fn offset_rest_skin(&self, py: Python<'_>, offsets: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let rows = ("#M", Some(self.skin_vertices));
        let offsets = offsets.map(|offsets| arrays::points(offsets, "offsets", rows)).transpose()?;
        self.with(py, |rig| rig.offset_rest_skin(offsets.as_deref()))?.or_raise()
    }

    /// Confines the cage to mask (#M,), 0 to 1, or not at all (None).
    #[pyo3(signature = (mask))]
    fn mask_skin(&self, py: Python<'_>, mask: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let rows = ("#M", Some(self.skin_vertices));
        let mask = mask.map(|mask| arrays::singles(mask, "mask", rows)).transpose()?;
        self.with(py, |rig| rig.mask_skin(mask.as_deref()))?.or_raise()
    }

    /// Stands the rig on what a lower cage has done to its cage (#C, 3) and joints (#J, 3).
    #[pyo3(signature = (cage, joints))]
    fn carry(
        &self,
        py: Python<'_>,
        cage: Option<&Bound<'_, PyAny>>,
        joints: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let cage = cage.map(|cage| self.cage(cage)).transpose()?;
        let joints =
            joints.map(|joints| arrays::points(joints, "joints", ("#J", Some(self.joints)))).transpose()?;
        let carried = match (cage, joints) {
            (Some(cage), Some(joints)) => Some(Carried { cage, joints }),
            (None, None) => None,
            _ => return Err(CageRigError::new_err("carry takes cage and joints together, or neither")),
        };
        self.with(py, |rig| rig.carry(carried))?.or_raise()
    }

    /// Changes how the bones move the visible skin; nothing else depends on it.
    fn set_method(&self, py: Python<'_>, name: &str) -> PyResult<()> {
        let method = cage_rig::skinning::method(name).or_raise()?;
        self.with(py, |rig| rig.set_method(method))
    }

    /// Whether frames keep Φ and Λ in 16 bits: less memory, faster, off by at most 2e-4 of the cage's movement.
    #[getter]
    fn half_weights(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |rig| rig.precision() == Precision::Half)
    }

    #[setter]
    fn set_half_weights(&self, py: Python<'_>, half: bool) -> PyResult<()> {
        self.with(py, |rig| rig.set_precision(precision(half)))
    }

    /// Whether frames are the same bit for bit whatever was before them, or as fast as can be.
    #[getter]
    fn reproducible(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, |rig| rig.is_reproducible())
    }

    #[setter]
    fn set_reproducible(&self, py: Python<'_>, reproducible: bool) -> PyResult<()> {
        self.with(py, |rig| rig.set_reproducible(reproducible))
    }

    /// Begins to change the method; the rig keeps the one that it has until the job's result() is called.
    fn start_method(&self, py: Python<'_>, name: &str) -> PyResult<MethodJob> {
        MethodJob::start(py, self, cage_rig::skinning::method(name).or_raise()?)
    }

    /// The name of the skinning method.
    #[getter]
    fn method(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.with(py, |rig| rig.method().name)
    }

    /// Posed skins (#F, #M, 3) of frames known in advance, as play and posed_skin give them: cages
    /// (#F, #C, 3), or (#C, 3) for a still one, and transforms (#F, #J, 4, 4). The rig stays as it is.
    #[pyo3(signature = (cages, transforms, rest_joints=None))]
    fn posed_skins<'py>(
        &self,
        py: Python<'py>,
        cages: &Bound<'py, PyAny>,
        transforms: &Bound<'py, PyAny>,
        rest_joints: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let transforms = arrays::transforms_of_frames(transforms, self.joints)?;
        let frames = transforms.len() / self.joints;
        let cages = arrays::cages(cages, frames, self.cage_vertices)?;
        let rest_joints = self.rest_joints(rest_joints)?;
        let mut posed = vec![[0.0f32; 3]; frames * self.skin_vertices];
        // A still cage comes once.
        let cage_of = |f: usize| &cages[f * self.cage_vertices % cages.len()..][..self.cage_vertices];
        let transforms = transforms.chunks_exact(self.joints).enumerate();
        let input: Vec<Frame> = transforms.map(|(f, transforms)| (cage_of(f), transforms)).collect();
        self.with(py, |rig| rig.posed_skins(&input, rest_joints.as_deref(), &mut posed))?.or_raise()?;
        PyArray1::from_vec(py, posed.into_flattened()).reshape([frames, self.skin_vertices, 3])
    }

    /// Writes rows of the posed skin, from row start on, into out (n, 3) or flat.
    #[pyo3(signature = (out, start=0))]
    fn posed_skin_into(&self, py: Python<'_>, out: &Bound<'_, PyAny>, start: usize) -> PyResult<()> {
        let mut out = Out::new(out)?;
        let view = out.view();
        self.with(py, |rig| view.write_singles(rig.posed_skin(), start))?
    }

    /// Writes rows of the rest skin, from row start on, into out (n, 3) or flat.
    #[pyo3(signature = (out, start=0))]
    fn rest_skin_into(&self, py: Python<'_>, out: &Bound<'_, PyAny>, start: usize) -> PyResult<()> {
        let mut out = Out::new(out)?;
        let view = out.view();
        self.with(py, |rig| view.write_singles(rig.rest_skin(), start))?
    }

    /// Writes the posed cage into out (#C, 3) or flat.
    fn posed_cage_into(&self, py: Python<'_>, out: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut out = Out::new(out)?;
        let view = out.view();
        self.with(py, |rig| {
            let cage: Vec<[f64; 3]> = rig.posed_cage().iter().map(|p| (*p).into()).collect();
            view.write(&cage, 0)
        })?
    }

    /// Rest skin (#M, 3), a copy.
    #[getter]
    fn rest_skin<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_frame(py, &self.with(py, |rig| rig.rest_skin().to_vec())?)
    }

    /// Posed skin (#M, 3), a copy.
    #[getter]
    fn posed_skin<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_frame(py, &self.with(py, |rig| rig.posed_skin().to_vec())?)
    }

    /// Rest cage (#C, 3), a copy.
    #[getter]
    fn rest_cage<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_points(py, &self.with(py, |rig| rig.rest_cage().to_vec())?)
    }

    /// Posed cage (#C, 3), a copy.
    #[getter]
    fn posed_cage<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_points(py, &self.with(py, |rig| rig.posed_cage().to_vec())?)
    }

    /// Rest joints (#J, 3), a copy.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_points(py, &self.with(py, |rig| rig.joints().to_vec())?)
    }

    /// Posed joints (#J, 3), a copy.
    #[getter]
    fn posed_joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_points(py, &self.with(py, |rig| rig.posed_joints())?)
    }

    /// Transforms of the refit skeleton (#J, 4, 4), a copy.
    #[getter]
    fn transforms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::from_transforms(py, &self.with(py, |rig| rig.transforms().to_vec())?)
    }

    /// What poses these bones (#J, 4, 4) as the refit skeleton, each in its own rest space.
    fn refit_pose<'py>(&self, py: Python<'py>, bones: &Bones) -> PyResult<Bound<'py, PyArray3<f64>>> {
        bones.check(self.joints)?;
        arrays::from_transforms(py, &self.with(py, |rig| bones.bones.refit(rig.transforms(), rig.joints()))?)
    }

    /// Cage coordinates (#M, #C), a copy.
    #[getter]
    fn cage_coords<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_rows(py, &self.with(py, |rig| rig.cage_coords().clone())?)
    }

    /// How much some cage vertices move each skin vertex together (#M,), where the cage reaches and its mask lets it.
    fn cage_influence<'py>(
        &self,
        py: Python<'py>,
        vertices: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let vertices = arrays::integers(vertices, "vertices")?;
        let influence = self.with(py, |rig| rig.cage_influence(&vertices))?.or_raise()?;
        Ok(PyArray1::from_vec(py, influence))
    }

    /// Joint coordinates (#J, #C), a copy.
    #[getter]
    fn joint_coords<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_rows(py, &self.with(py, |rig| rig.joint_coords().clone())?)
    }

    /// Center coordinates (#M, #C), a copy, or None before a method has needed them.
    #[getter]
    fn center_coords<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let coords = self.with(py, |rig| rig.center_coords().cloned())?;
        coords.map(|coords| arrays::from_rows(py, &coords)).transpose()
    }

    /// Anchor skin vertices.
    #[getter]
    fn anchors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let anchors = self.with(py, |rig| rig.anchors().iter().map(|&i| i as i64).collect())?;
        Ok(PyArray1::from_vec(py, anchors))
    }

    /// Bounding-box diagonal of the skin at bind.
    #[getter]
    fn size(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |rig| rig.size())
    }

    /// What the bind found and did.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.with(py, |rig| rig.report().clone())?;
        let report = PyDict::new(py);
        report.set_item("cage_turned", found.cage_turned)?;
        report.set_item("joints_outside_hull", found.joints_outside_hull)?;
        report.set_item("unweighted_joints", found.unweighted_joints)?;
        report.set_item("unweighted_vertices", found.unweighted_vertices)?;
        report.set_item("vertices_outside", found.vertices_outside)?;
        report.set_item("vertices_out_of_reach", found.vertices_out_of_reach)?;
        report.set_item("anchor_max_ratio", found.anchor_max_ratio)?;
        report.set_item("anchor_swaps", found.anchor_swaps)?;
        report.set_item("anchor_condition", found.anchor_condition)?;
        report.set_item("regularised", found.regularised)?;
        report.set_item("joint_error_max", found.joint_error_max)?;
        report.set_item("coordinate_error_max", found.coordinate_error_max)?;
        Ok(report)
    }

    /// How often something expensive was done since the bind.
    #[getter]
    fn work<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let done = self.with(py, |rig| rig.work())?;
        let work = PyDict::new(py);
        work.set_item("anchor_factorisations", done.anchor_factorisations)?;
        work.set_item("reverse_factorisations", done.reverse_factorisations)?;
        work.set_item("reverse_low_rank", done.reverse_low_rank)?;
        work.set_item("reverse_solves", done.reverse_solves)?;
        work.set_item("rest_passes", done.rest_passes)?;
        work.set_item("rest_column_passes", done.rest_column_passes)?;
        work.set_item("rest_shape_passes", done.rest_shape_passes)?;
        work.set_item("skin_passes", done.skin_passes)?;
        work.set_item("cage_fits", done.cage_fits)?;
        work.set_item("center_integrations", done.center_integrations)?;
        work.set_item("center_passes", done.center_passes)?;
        work.set_item("center_column_passes", done.center_column_passes)?;
        work.set_item("center_shape_passes", done.center_shape_passes)?;
        Ok(work)
    }

    /// Panics while holding the rig: lets tests see that a panic stays an exception.
    #[allow(clippy::panic)]
    fn _panic_for_tests(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |_| panic!("asked to by a test"))
    }

    fn __repr__(&self) -> String {
        let Self { skin_vertices, joints, cage_vertices, .. } = self;
        format!("<CoupledRig: {skin_vertices} skin vertices, {joints} joints, {cage_vertices} cage vertices>")
    }
}
