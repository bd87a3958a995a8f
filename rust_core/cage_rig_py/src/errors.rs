//! Exceptions: one for each thing a user brings, all of them `ValueError`s; and one for work that nobody wants any more.

use cage_rig::Error;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;

create_exception!(cage_rig_core, CageRigError, PyValueError, "Something handed to the core is not usable.");
create_exception!(cage_rig_core, CageError, CageRigError, "A mesh cannot serve as a cage.");
create_exception!(cage_rig_core, SkinError, CageRigError, "A mesh cannot serve as a skin.");
create_exception!(cage_rig_core, WeightsError, CageRigError, "Weights cannot bind a skin to joints.");
create_exception!(cage_rig_core, SkeletonError, CageRigError, "Joints and parents are no skeleton.");
create_exception!(
    cage_rig_core,
    PoseError,
    CageRigError,
    "An edit cannot be carried out; the rig is as it was."
);
create_exception!(
    cage_rig_core,
    CagingError,
    CageRigError,
    "No cage was generated; `node` and `place` say where the fault is, `section` which one of a cage to be like, or are None."
);
create_exception!(
    cage_rig_core,
    ArrayError,
    CageRigError,
    "An argument has the wrong shape, type or values."
);

create_exception!(cage_rig_core, Cancelled, PyException, "A job was cancelled; nothing of it is left.");

/// The exception for a fault of the core.
pub(crate) fn raise(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let message = error.to_string();
    match error {
        Error::Cage(_) => CageError::new_err(message),
        Error::Skin(_) => SkinError::new_err(message),
        Error::Weights(_) => WeightsError::new_err(message),
        Error::Skeleton(_) => SkeletonError::new_err(message),
        Error::Pose(_) => PoseError::new_err(message),
        Error::Cancelled(_) => Cancelled::new_err(message),
        Error::Size { .. } | Error::NotFinite { .. } | Error::AllZero { .. } => ArrayError::new_err(message),
        Error::Caging(fault) => caging_error(&fault, message),
        Error::UnknownName { .. } | Error::Option { .. } => CageRigError::new_err(message),
    }
}

fn caging_error(fault: &cage_rig::CagingError, message: String) -> PyErr {
    let raised = CagingError::new_err(message);
    let (node, place) = fault.place();
    let named = Python::attach(|py| {
        let value = raised.value(py);
        value.setattr("node", node)?;
        value.setattr("section", fault.section())?;
        value.setattr("cancelled", matches!(fault, cage_rig::CagingError::Cancelled(_)))?;
        value.setattr("place", place.map(|p| (p.x, p.y, p.z)))
    });
    named.err().unwrap_or(raised)
}

/// What a progress callable that wants no more gets.
pub(crate) fn cancelled(_py: Python<'_>) -> PyErr {
    let fault = cage_rig::CagingError::from(cage_rig::Cancelled);
    caging_error(&fault, fault.to_string())
}

/// `?` for the core's results.
pub(crate) trait OrRaise<T> {
    /// The value, or the exception.
    fn or_raise(self) -> PyResult<T>;
}

impl<T, E: Into<Error>> OrRaise<T> for Result<T, E> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(raise)
    }
}

pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("CageRigError", py.get_type::<CageRigError>())?;
    module.add("CagingError", py.get_type::<CagingError>())?;
    module.add("CageError", py.get_type::<CageError>())?;
    module.add("SkinError", py.get_type::<SkinError>())?;
    module.add("WeightsError", py.get_type::<WeightsError>())?;
    module.add("SkeletonError", py.get_type::<SkeletonError>())?;
    module.add("PoseError", py.get_type::<PoseError>())?;
    module.add("ArrayError", py.get_type::<ArrayError>())?;
    module.add("Cancelled", py.get_type::<Cancelled>())
}
