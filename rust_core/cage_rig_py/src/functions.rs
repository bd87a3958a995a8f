//! The module's functions: coordinates of points, checks of a cage, what families have.

use crate::arrays;
use crate::errors::OrRaise;
use cage_rig::coordinates::{mean_value, KINDS};
use cage_rig::skinning::METHODS;
use cage_rig::{unwatched, Cage};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Mean value coordinates (#points, #C) of points with respect to a closed cage.
#[pyfunction]
fn mean_value_coordinates<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    cage_vertices: &Bound<'py, PyAny>,
    cage_faces: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let points = arrays::points(points, "points", ("n", None))?;
    let vertices = arrays::points(cage_vertices, "cage_vertices", ("#C", None))?;
    let faces = arrays::polygons(cage_faces, "cage_faces")?;
    let rows = py
        .detach(|| {
            Cage::new(vertices, &faces)
                .map(|cage| unwatched(|part| mean_value::coordinates(&cage, &points, part)))
        })
        .or_raise()?;
    arrays::from_rows(py, &rows)
}

/// Checks a cage. Returns whether it was inside out ("turned") and its "triangles" (#T, 3), outward.
#[pyfunction]
fn check_cage<'py>(
    py: Python<'py>,
    cage_vertices: &Bound<'py, PyAny>,
    cage_faces: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let vertices = arrays::points(cage_vertices, "cage_vertices", ("#C", None))?;
    let faces = arrays::polygons(cage_faces, "cage_faces")?;
    let cage = py.detach(|| Cage::new(vertices, &faces)).or_raise()?;
    let corners: Vec<i64> = cage.triangles().iter().flatten().map(|&v| i64::from(v)).collect();
    let found = PyDict::new(py);
    found.set_item("turned", cage.turned())?;
    found.set_item("triangles", PyArray1::from_vec(py, corners).reshape([cage.triangles().len(), 3])?)?;
    Ok(found)
}

/// The names of the skinning methods; the first is the default.
#[pyfunction]
fn skinning_methods() -> Vec<&'static str> {
    METHODS.iter().map(|method| method.name).collect()
}

/// The names of the kinds of cage coordinates; the first is the default.
#[pyfunction]
fn coordinate_kinds() -> Vec<&'static str> {
    KINDS.iter().map(|kind| kind.name).collect()
}

pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(mean_value_coordinates, module)?)?;
    module.add_function(wrap_pyfunction!(check_cage, module)?)?;
    module.add_function(wrap_pyfunction!(skinning_methods, module)?)?;
    module.add_function(wrap_pyfunction!(coordinate_kinds, module)?)
}
