//! What a bind takes, checked at the door.

use crate::arrays;
use crate::errors::{CageRigError, OrRaise};
use cage_rig::simd::Path;
use cage_rig::sync::{BindInput, BindOptions, Known};
use cage_rig::{Cage, Precision, Skeleton};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The three meshes and their weights, as they came.
pub(crate) struct Meshes<'a, 'py> {
    pub(crate) skin_vertices: &'a Bound<'py, PyAny>,
    pub(crate) skin_faces: &'a Bound<'py, PyAny>,
    pub(crate) skin_weights: &'a Bound<'py, PyAny>,
    pub(crate) joints: &'a Bound<'py, PyAny>,
    pub(crate) parents: &'a Bound<'py, PyAny>,
    pub(crate) cage_vertices: &'a Bound<'py, PyAny>,
    pub(crate) cage_faces: &'a Bound<'py, PyAny>,
}

/// What need not be computed, as it came.
pub(crate) struct Given<'a, 'py> {
    pub(crate) anchors: Option<&'a Bound<'py, PyAny>>,
    pub(crate) cage_coords: Option<&'a Bound<'py, PyAny>>,
    pub(crate) joint_coords: Option<&'a Bound<'py, PyAny>>,
    pub(crate) center_coords: Option<&'a Bound<'py, PyAny>>,
}

/// Checks what came for a bind. `names` are those of the skinning method and of the coordinates.
pub(crate) fn read_input(
    py: Python<'_>,
    meshes: &Meshes<'_, '_>,
    given: &Given<'_, '_>,
    names: (&str, &str),
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<BindInput> {
    let skin = arrays::points(meshes.skin_vertices, "skin_vertices", ("#M", None))?;
    let cage = arrays::points(meshes.cage_vertices, "cage_vertices", ("#C", None))?;
    let joints = arrays::points(meshes.joints, "joints", ("#J", None))?;
    let (m, c, j) = (("#M", Some(skin.len())), ("#C", Some(cage.len())), ("#J", Some(joints.len())));
    let matrix = |value: Option<&Bound<'_, PyAny>>, name, shape| {
        value.map(|value| arrays::matrix(value, name, shape)).transpose()
    };
    let known = Known {
        anchors: given.anchors.map(|anchors| arrays::integers(anchors, "anchors")).transpose()?,
        cage_coords: matrix(given.cage_coords, "cage_coords", [m, c])?,
        joint_coords: matrix(given.joint_coords, "joint_coords", [j, c])?,
        center_coords: matrix(given.center_coords, "center_coords", [m, c])?,
    };
    let cage_faces = arrays::polygons(meshes.cage_faces, "cage_faces")?;
    let parents = arrays::integers(meshes.parents, "parents")?;
    Ok(BindInput {
        skin_weights: arrays::weights(meshes.skin_weights, skin.len(), joints.len())?,
        skin_vertices: skin,
        skin_faces: arrays::polygons(meshes.skin_faces, "skin_faces")?,
        skeleton: Skeleton::new(joints, &parents).or_raise()?,
        cage: py.detach(|| Cage::new(cage, &cage_faces)).or_raise()?,
        method: cage_rig::skinning::method(names.0).or_raise()?,
        coordinates: cage_rig::coordinates::kind(names.1).or_raise()?,
        known,
        options: read_options(options)?,
    })
}

fn read_options(given: Option<&Bound<'_, PyDict>>) -> PyResult<BindOptions> {
    let mut options = BindOptions::default();
    for (key, value) in given.into_iter().flatten() {
        match key.extract::<String>()?.as_str() {
            "max_anchor_ratio" => options.maxvol.max_ratio = value.extract()?,
            "max_anchor_swaps" => options.maxvol.max_swaps = value.extract()?,
            "locality_exponent" => options.locality_exponent = value.extract()?,
            "min_singular" => options.min_singular = value.extract()?,
            "falloff" => options.falloff = value.extract()?,
            "center_sigma" => options.centers.sigma = value.extract()?,
            "center_bins" => options.centers.bins = value.extract()?,
            "half_weights" => options.precision = precision(value.extract()?),
            "instructions" => options.path = path(&value.extract::<String>()?)?,
            unknown => {
                return Err(CageRigError::new_err(format!(
                    "there is no option named {unknown:?}; known: max_anchor_ratio, max_anchor_swaps, locality_exponent, min_singular, falloff, center_sigma, center_bins, half_weights, instructions"
                )))
            }
        }
    }
    Ok(options)
}

pub(crate) fn precision(half: bool) -> Precision {
    if half {
        Precision::Half
    } else {
        Precision::Single
    }
}

fn path(name: &str) -> PyResult<Path> {
    let available = Path::available();
    available.iter().find(|path| path.name() == name).copied().ok_or_else(|| {
        let known: Vec<_> = available.iter().map(|path| path.name()).collect();
        let known = known.join(", ");
        CageRigError::new_err(format!("this processor has no instructions named {name:?}; it has {known}"))
    })
}
