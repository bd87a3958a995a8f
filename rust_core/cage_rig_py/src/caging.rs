//! Cages from skins and skeletons: `generate_cage` and its preview `cage_sections`.

use crate::arrays;
use crate::errors::{raise, CageRigError, OrRaise};
use cage_rig::caging::{
    CageReport, CagingOptions, GeneratedCage, Generator, NodeKind, Placement, Progress, SectionReport,
};
use cage_rig::{CagingError, Point};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// What Python hands in, read.
struct Input {
    generator: Generator,
    bending: Option<Vec<Point>>,
}

/// Tells a Python callable about the progress, at most ten times a second, and keeps what it raised.
struct Teller {
    call: Option<Py<PyAny>>,
    state: Mutex<(Option<Instant>, Option<PyErr>)>,
}

impl Teller {
    fn tell(&self, stage: &'static str, part: f64) -> bool {
        let Ok(mut state) = self.state.lock() else { return false };
        if state.1.is_some() {
            return false;
        }
        if state.0.is_some_and(|at| at.elapsed() < Duration::from_millis(100)) {
            return true;
        }
        state.0 = Some(Instant::now());
        let answer = Python::attach(|py| -> PyResult<bool> {
            py.check_signals()?;
            let Some(call) = &self.call else { return Ok(true) };
            let answer = call.bind(py).call1((stage, part))?;
            Ok(answer.is_none() || answer.is_truthy()?)
        });
        answer.unwrap_or_else(|error| {
            state.1 = Some(error);
            false
        })
    }

    fn raised(self, error: CagingError) -> PyErr {
        let kept = self.state.into_inner().ok().and_then(|(_, raised)| raised);
        kept.unwrap_or_else(|| raise(error))
    }
}

fn read(
    py: Python<'_>,
    skin: [&Bound<'_, PyAny>; 2],
    skeleton: [&Bound<'_, PyAny>; 2],
    bending: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Input> {
    let vertices = arrays::points(skin[0], "vertices", ("#V", None))?;
    let faces = arrays::polygons(skin[1], "faces")?;
    let nodes = arrays::points(skeleton[0], "nodes", ("#N", None))?;
    let edges = arrays::pairs(skeleton[1], "edges")?;
    let bending = bending.map(|b| arrays::points(b, "bending_nodes", ("#B", None))).transpose()?;
    let options = read_options(options)?;
    let generator = py.detach(|| Generator::new(&vertices, &faces, &nodes, &edges, options)).or_raise()?;
    Ok(Input { generator, bending })
}

/// Builds a cage around a closed skin (vertices (#V, 3), faces) from its skeleton (nodes (#N, 3),
/// edges (#E, 2)). Returns its vertices, its faces (corner indices, face sizes), and a report.
#[pyfunction]
#[pyo3(signature = (vertices, faces, nodes, edges, *, bending_nodes=None, options=None, progress=None))]
#[allow(clippy::too_many_arguments)] // the names are keywords in Python
fn generate_cage<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    nodes: &Bound<'py, PyAny>,
    edges: &Bound<'py, PyAny>,
    bending_nodes: Option<&Bound<'py, PyAny>>,
    options: Option<&Bound<'py, PyDict>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let input = read(py, [vertices, faces], [nodes, edges], bending_nodes, options)?;
    let teller = Teller { call: progress, state: Mutex::new((None, None)) };
    let found = py.detach(|| {
        let listener = |stage: &'static str, part: f64| teller.tell(stage, part);
        input.generator.generate(input.bending.as_deref(), &Progress::new(&listener))
    });
    let GeneratedCage { vertices, faces, report } = found.map_err(|error| teller.raised(error))?;
    let sizes: Vec<i64> = faces.sizes.iter().map(|s| *s as i64).collect();
    let corners = PyArray1::from_vec(py, faces.corners);
    let vertices = arrays::from_points(py, &vertices)?;
    if sizes.iter().all(|s| *s == 3) {
        let triangles = corners.reshape([sizes.len(), 3])?;
        return (vertices, triangles, report_dict(py, &report)?).into_pyobject(py);
    }
    let faces = (corners, PyArray1::from_vec(py, sizes));
    (vertices, faces, report_dict(py, &report)?).into_pyobject(py)
}

/// The cross sections that `generate_cage` would join, without the cage: a list of dictionaries.
#[pyfunction]
#[pyo3(signature = (vertices, faces, nodes, edges, *, bending_nodes=None, options=None))]
fn cage_sections<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    nodes: &Bound<'py, PyAny>,
    edges: &Bound<'py, PyAny>,
    bending_nodes: Option<&Bound<'py, PyAny>>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyList>> {
    let input = read(py, [vertices, faces], [nodes, edges], bending_nodes, options)?;
    let found =
        py.detach(|| input.generator.sections(input.bending.as_deref(), &Progress::silent())).or_raise()?;
    section_list(py, &found)
}

fn section_list<'py>(py: Python<'py>, sections: &[SectionReport]) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for section in sections {
        let entry = PyDict::new(py);
        entry.set_item("kind", if section.kind == NodeKind::Leaf { "leaf" } else { "bending" })?;
        entry.set_item("point", point(py, &section.point))?;
        entry.set_item("direction", point(py, &section.direction))?;
        entry.set_item("radius", section.radius)?;
        entry.set_item("node", section.node)?;
        entry.set_item("arc", section.arc)?;
        entry.set_item("ring", arrays::from_points(py, &section.ring)?)?;
        entry.set_item("corners", arrays::from_points(py, &section.corners)?)?;
        list.append(entry)?;
    }
    Ok(list)
}

fn point<'py>(py: Python<'py>, p: &Point) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, p.as_slice())
}

fn report_dict<'py>(py: Python<'py>, report: &CageReport) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("sections", section_list(py, &report.sections)?)?;
    let owners: Vec<i64> = report.vertex_sections.iter().map(|s| *s as i64).collect();
    found.set_item("vertex_sections", PyArray1::from_vec(py, owners))?;
    found.set_item("dropped_nodes", report.dropped.clone())?;
    let repairs = PyDict::new(py);
    repairs.set_item("welded", report.repairs.welded)?;
    repairs.set_item("left_out", report.repairs.left_out)?;
    repairs.set_item("turned", report.repairs.turned)?;
    repairs.set_item("inside_out", report.repairs.inside_out)?;
    repairs.set_item("parts", report.repairs.parts)?;
    found.set_item("repairs", repairs)?;
    found.set_item("volume_ratio", report.volume_ratio)?;
    found.set_item("mean_distance", report.mean_distance)?;
    found.set_item("clearance", report.clearance)?;
    found.set_item("min_angle", report.min_angle)?;
    found.set_item("genus", report.genus)?;
    let mirror = report.mirror.as_ref().map(|m| PyArray1::from_iter(py, m.iter().map(|v| i64::from(*v))));
    found.set_item("mirror", mirror)?;
    let timings = PyDict::new(py);
    for (stage, seconds) in &report.timings {
        timings.set_item(stage, seconds)?;
    }
    found.set_item("timings", timings)?;
    Ok(found)
}

const OPTIONS: &str =
    "placement, grid, corners, reach, clearance, tightness, rounds, triangles, detail, asymmetric";

fn read_options(given: Option<&Bound<'_, PyDict>>) -> PyResult<CagingOptions> {
    let mut options = CagingOptions::default();
    for (key, value) in given.into_iter().flatten() {
        match key.extract::<String>()?.as_str() {
            "placement" => {
                options.placement = match value.extract::<String>()?.as_str() {
                    "automatic" => Placement::Automatic,
                    "joints" => Placement::Joints,
                    name => {
                        let message =
                            format!("there is no placement named {name:?}; known: automatic, joints");
                        return Err(CageRigError::new_err(message));
                    }
                }
            }
            "grid" => options.sections.grid = value.extract()?,
            "corners" => options.sections.corners = value.extract()?,
            "reach" => options.inflation.reach = value.extract()?,
            "clearance" => options.inflation.clearance = value.extract()?,
            "tightness" => options.inflation.tightness = value.extract()?,
            "rounds" => options.inflation.rounds = value.extract()?,
            "triangles" => options.triangles = value.extract()?,
            "detail" => options.detail = value.extract()?,
            "asymmetric" => options.asymmetric = value.extract()?,
            unknown => {
                let message = format!("there is no option named {unknown:?}; known: {OPTIONS}");
                return Err(CageRigError::new_err(message));
            }
        }
    }
    Ok(options)
}

pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(generate_cage, module)?)?;
    module.add_function(wrap_pyfunction!(cage_sections, module)?)
}
