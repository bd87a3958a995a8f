//! `cage_rig_core`: the Python module. A thin wrapper of `cage_rig` with the same names: it checks
//! arrays at the door, releases the GIL around work, and turns errors into exceptions.

mod arrays;
mod bones;
mod caging;
mod errors;
mod functions;
mod input;
mod jobs;
mod playback;
mod rig;

use pyo3::prelude::*;

/// Coupled cages and skeletons: the core of Cage Rig.
#[pymodule]
fn cage_rig_core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PanicException", module.py().get_type::<pyo3::panic::PanicException>())?;
    module.add_class::<rig::CoupledRig>()?;
    module.add_class::<bones::Bones>()?;
    module.add_class::<playback::Playback>()?;
    module.add_class::<jobs::BindJob>()?;
    module.add_class::<jobs::MethodJob>()?;
    functions::add_to(module)?;
    caging::add_to(module)?;
    errors::add_to(module)
}
