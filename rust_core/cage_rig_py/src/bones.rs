//! `Bones` for Python: rest matrices of an armature, and what animation and refit make of them.

use crate::arrays;
use crate::errors::{ArrayError, CageRigError};
use cage_rig::bones::TailLink;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;

/// An armature's bones at rest, in rig space.
#[pyclass(frozen, module = "cage_rig_core")]
pub(crate) struct Bones {
    pub(crate) bones: cage_rig::bones::Bones,
    joints: usize,
}

impl Bones {
    /// Refuses a rig that has another number of joints.
    pub(crate) fn check(&self, joints: usize) -> PyResult<()> {
        if joints == self.joints {
            return Ok(());
        }
        let found = self.joints;
        Err(CageRigError::new_err(format!("the rig has {joints} joints, these are {found} bones")))
    }
}

#[pymethods]
impl Bones {
    /// Bones of rest matrices (#J, 4, 4), and which of their tails follow a joint: pairs (bone, child)
    /// with lengths.
    #[new]
    #[pyo3(signature = (rest, tail_links=None, lengths=None))]
    fn new(
        rest: &Bound<'_, PyAny>,
        tail_links: Option<&Bound<'_, PyAny>>,
        lengths: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let rest = arrays::matrices(rest, "rest", None)?;
        let joints = rest.len();
        let pairs = tail_links.map_or_else(|| Ok(vec![]), |links| arrays::pairs(links, "tail_links"))?;
        let rows = ("#links", Some(pairs.len()));
        let lengths =
            lengths.map_or_else(|| Ok(vec![]), |lengths| arrays::singles(lengths, "lengths", rows))?;
        let index = |bone: i64| {
            usize::try_from(bone).ok().filter(|bone| *bone < joints).ok_or_else(|| {
                ArrayError::new_err(format!("tail_links names bone {bone}, but there are {joints} bones"))
            })
        };
        let link = |(pair, length): (&[i64; 2], &f32)| {
            Ok(TailLink { bone: index(pair[0])?, child: index(pair[1])?, length: f64::from(*length) })
        };
        let links: PyResult<Vec<TailLink>> = pairs.iter().zip(&lengths).map(link).collect();
        Ok(Self { bones: cage_rig::bones::Bones::new(rest, links?), joints })
    }

    /// Where the bones begin (#J, 3), a copy.
    #[getter]
    fn heads<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::from_points(py, &self.bones.heads())
    }

    /// The animation's transforms (#J, 4, 4) where its bones are posed (#J, 4, 4); the identity at rest.
    fn transforms<'py>(
        &self,
        py: Python<'py>,
        posed: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let posed = arrays::matrices(posed, "posed", Some(self.joints))?;
        arrays::from_transforms(py, &self.bones.transforms(&posed))
    }
}
