//! `Playback` for Python: frames from arrays into arrays, which are looked at once for all of them. What a
//! frame reads and shows takes one call.

use crate::arrays::{self, kept};
use crate::bones::Bones;
use crate::errors::{ArrayError, CageRigError, OrRaise};
use crate::rig::CoupledRig;
use cage_rig::Point;
use numpy::ndarray::{ArrayViewMut2, ArrayViewMut3};
use numpy::{PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// A rig, and where its frames come from and go to.
#[pyclass(frozen, module = "cage_rig_core")]
pub(crate) struct Playback {
    rig: CoupledRig,
    base: Vec<Point>,
    bones: Py<Bones>,
    refit: Option<Py<Bones>>,
    cage: Py<PyArray2<f32>>,
    posed: Py<PyArray3<f32>>,
    skin: Py<PyArray2<f32>>,
    posed_cage: Py<PyArray2<f32>>,
    refit_pose: Py<PyArray3<f32>>,
}

#[pymethods]
impl Playback {
    #[new]
    #[pyo3(signature = (rig, bones, refit=None, *, cage, posed, skin, posed_cage, refit_pose))]
    #[allow(clippy::too_many_arguments)] // the arrays are keywords in Python
    fn new(
        py: Python<'_>,
        rig: &CoupledRig,
        bones: Py<Bones>,
        refit: Option<Py<Bones>>,
        cage: &Bound<'_, PyAny>,
        posed: &Bound<'_, PyAny>,
        skin: &Bound<'_, PyAny>,
        posed_cage: &Bound<'_, PyAny>,
        refit_pose: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let points = |rows| [rows, ("3", Some(3))];
        let matrices = [("#J", Some(rig.joints)), ("4", Some(4)), ("4", Some(4))];
        let (cages, skins) =
            (points(("#C", Some(rig.cage_vertices))), points(("#M", Some(rig.skin_vertices))));
        bones.get().check(rig.joints)?;
        refit.iter().try_for_each(|refit| refit.get().check(rig.joints))?;
        let playback = Self {
            base: rig.with(py, |rig| rig.cage().vertices().to_vec())?,
            cage: kept(cage, "cage", &cages)?,
            posed: kept(posed, "posed", &matrices)?,
            skin: kept(skin, "skin", &skins)?,
            posed_cage: kept(posed_cage, "posed_cage", &cages)?,
            refit_pose: kept(refit_pose, "refit_pose", &matrices)?,
            rig: rig.clone(),
            bones,
            refit,
        };
        if !playback.skin.bind(py).is_c_contiguous() {
            return Err(ArrayError::new_err("skin must be contiguous"));
        }
        Ok(playback)
    }

    /// Plays the cage and the bones that the arrays have now, as play_posed does; influence: the part of the
    /// cage's movement that counts. Where anything of it was new, or where it is to be shown again, what
    /// is shown is written: the skin, the posed cage where it is fitted, and the pose of refit bones.
    #[pyo3(signature = (influence=1.0, *, fitted=true, again=false))]
    fn play(&self, py: Python<'_>, influence: f64, fitted: bool, again: bool) -> PyResult<bool> {
        let influenced = |c: Point, row: usize| match influence {
            1.0 => c,
            part => self.base[row] + (c - self.base[row]) * part,
        };
        let cage = arrays::kept_points(self.cage.bind(py), "cage", influenced)?;
        let posed = arrays::kept_matrices(self.posed.bind(py), "posed")?;
        let (mut skin, mut posed_cage, mut refit_pose) = (
            self.skin.bind(py).try_readwrite().map_err(held)?,
            self.posed_cage.bind(py).try_readwrite().map_err(held)?,
            self.refit_pose.bind(py).try_readwrite().map_err(held)?,
        );
        let (skin, posed_cage, refit_pose) =
            (skin.as_slice_mut()?, posed_cage.as_array_mut(), refit_pose.as_array_mut());
        let (bones, refit) = (&self.bones.get().bones, self.refit.as_ref().map(|refit| &refit.get().bones));
        let frame = |rig: &mut cage_rig::CoupledRig| {
            let new = rig.play(&cage, &bones.transforms(&posed), Some(&bones.heads()))?;
            if new || again {
                rig.posed_skin_into(skin.as_chunks_mut().0);
                if fitted {
                    write_points(rig.posed_cage(), posed_cage);
                }
                if let Some(refit) = refit {
                    write_matrices(&refit.refit(rig.transforms(), rig.joints()), refit_pose);
                }
            }
            Ok::<_, cage_rig::PoseError>(new)
        };
        self.rig.with(py, frame)?.or_raise()
    }
}

fn held(_: numpy::BorrowError) -> PyErr {
    CageRigError::new_err("the arrays of a playback must be writable and not in use elsewhere")
}

fn write_points(points: &[Point], mut out: ArrayViewMut2<f32>) {
    for (mut out, point) in out.outer_iter_mut().zip(points) {
        out.iter_mut().zip(point.iter()).for_each(|(out, x)| *out = *x as f32);
    }
}

fn write_matrices(matrices: &[cage_rig::Transform], mut out: ArrayViewMut3<f32>) {
    for (mut out, matrix) in out.outer_iter_mut().zip(matrices) {
        for row in 0..3 {
            (0..3).for_each(|column| out[[row, column]] = matrix.linear[(row, column)] as f32);
            out[[row, 3]] = matrix.translation[row] as f32;
        }
        (0..4).for_each(|column| out[[3, column]] = if column == 3 { 1.0 } else { 0.0 });
    }
}
