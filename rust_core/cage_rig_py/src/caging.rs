//! Cages from skins and skeletons: `generate_cage` and its preview `cage_sections`.

use crate::arrays;
use crate::errors::{cancelled, CageRigError, OrRaise};
use crate::jobs::Job;
use cage_rig::caging::{
    CageReport, CagingOptions, Earlier, GeneratedCage, Generator, NodeKind, Placement, Repairs, RoughCage,
    SectionReport, Template,
};
use cage_rig::{CagingError, Error, Point, Polygons, Progress, Stage};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::Arc;

/// Seconds between two looks at the work.
const TELLING: f64 = 0.05;

/// What Python hands in, read.
struct Input {
    vertices: Vec<Point>,
    faces: Polygons,
    nodes: Vec<Point>,
    edges: Vec<[i64; 2]>,
    options: CagingOptions,
}

impl Input {
    fn read(
        skin: [&Bound<'_, PyAny>; 2],
        skeleton: [&Bound<'_, PyAny>; 2],
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        Ok(Self {
            vertices: arrays::points(skin[0], "vertices", ("#V", None))?,
            faces: arrays::polygons(skin[1], "faces")?,
            nodes: arrays::points(skeleton[0], "nodes", ("#N", None))?,
            edges: arrays::pairs(skeleton[1], "edges")?,
            options: read_options(options)?,
        })
    }

    fn generator(self) -> Result<Generator, CagingError> {
        Generator::new(&self.vertices, &self.faces, &self.nodes, &self.edges, self.options)
    }
}

/// Vertices, faces, and vertices of a cross section.
type LikeCage<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, usize);

fn template((vertices, faces, corners): LikeCage<'_>) -> PyResult<Template> {
    let vertices = arrays::points(&vertices, "vertices to be like", ("#C", None))?;
    Ok(Template { vertices, faces: arrays::polygons(&faces, "faces to be like")?, corners })
}

fn bending_points(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<Point>>> {
    given.map(|b| arrays::points(b, "bending_nodes", ("#B", None))).transpose()
}

/// A cage generated in a thread of its own: takes what `generate_cage` takes, and begins at once.
#[pyclass(frozen, module = "cage_rig_core")]
pub(crate) struct CagingJob(Job<Arc<GeneratedCage>>);

impl CagingJob {
    fn start(
        work: impl FnOnce(&Progress) -> Result<GeneratedCage, CagingError> + Send + 'static,
    ) -> PyResult<Self> {
        let work = move |progress: &Progress| {
            work(progress).map_err(|fault| match fault {
                CagingError::Cancelled(cancelled) => cancelled.into(),
                fault => Error::from(fault),
            })
        };
        Ok(Self(Job::start(work, Arc::new)?))
    }

    /// Waits for the result, telling a function of Python how far it is, which may cancel it. The function
    /// learns of every stage, however short.
    fn watched<'py>(
        &self,
        py: Python<'py>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let Some(call) = progress else { return self.result(py) };
        let (mut last, mut told) = (0, None::<Stage>);
        loop {
            let found = if self.wait(py, Some(TELLING))? { Some(self.result(py)?) } else { None };
            let news = self.0.stages_from(last);
            last += news.len().saturating_sub(1);
            for news in news {
                // The stage that was told last may come again as it began.
                if told.is_none_or(|told| told != news && told.1 <= news.1) {
                    told = Some(news);
                    let answer = call.call1(news)?;
                    if !answer.is_none() && !answer.is_truthy()? {
                        return Err(cancelled(py));
                    }
                }
            }
            if let Some(found) = found {
                return Ok(found);
            }
        }
    }
}

#[pymethods]
impl CagingJob {
    #[new]
    #[pyo3(signature = (vertices, faces, nodes, edges, *, bending_nodes=None, options=None, like=None))]
    #[allow(clippy::too_many_arguments)] // the names are keywords in Python
    fn new(
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        nodes: &Bound<'_, PyAny>,
        edges: &Bound<'_, PyAny>,
        bending_nodes: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
        like: Option<LikeCage<'_>>,
    ) -> PyResult<Self> {
        let input = Input::read([vertices, faces], [nodes, edges], options)?;
        let bending = bending_points(bending_nodes)?;
        let like = like.map(template).transpose()?;
        Self::start(move |progress| {
            let (generator, part) = (input.generator()?, progress.whole());
            match &like {
                Some(template) => generator.generate_like(bending.as_deref(), template, None, &part),
                None => generator.generate(bending.as_deref(), None, &part),
            }
        })
    }

    /// How much is done, 0 to 1. Never falls.
    #[getter]
    fn progress(&self) -> f64 {
        self.0.share()
    }

    /// What is being computed, for people; empty before it begins.
    #[getter]
    fn stage(&self) -> &'static str {
        self.0.stage()
    }

    /// Whether result() answers at once.
    #[getter]
    fn done(&self) -> bool {
        self.0.is_done()
    }

    /// Stops it soon, unless it is done: then result() raises Cancelled.
    fn cancel(&self, py: Python<'_>) {
        self.0.cancel(py);
    }

    /// Waits until it is done, or for so many seconds; returns whether it is done.
    #[pyo3(signature = (seconds=None))]
    fn wait(&self, py: Python<'_>, seconds: Option<f64>) -> PyResult<bool> {
        self.0.wait(py, seconds)
    }

    /// Vertices, faces and report as of generate_cage, once it is done; raises what that refuses.
    fn result<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        cage_tuple(py, &*self.0.result(py)?)
    }

    fn __repr__(&self) -> String {
        self.0.describe("CagingJob")
    }
}

/// Bending nodes, vertices and faces.
type EarlierCage<'py> = (Option<Bound<'py, PyAny>>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// A skin and its skeleton, kept: another call traces only the sections that its bending nodes changed.
#[pyclass(frozen, module = "cage_rig_core")]
pub(crate) struct CageGenerator(Arc<Generator>);

#[pymethods]
impl CageGenerator {
    #[new]
    #[pyo3(signature = (vertices, faces, nodes, edges, *, options=None))]
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        nodes: &Bound<'_, PyAny>,
        edges: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let input = Input::read([vertices, faces], [nodes, edges], options)?;
        Ok(Self(Arc::new(py.detach(|| input.generator()).or_raise()?)))
    }

    /// As cage_sections; those of a cage `like` another one, as in generate_cage.
    #[pyo3(signature = (bending_nodes=None, *, like=None))]
    fn sections<'py>(
        &self,
        py: Python<'py>,
        bending_nodes: Option<&Bound<'py, PyAny>>,
        like: Option<LikeCage<'py>>,
    ) -> PyResult<Bound<'py, PyList>> {
        let bending = bending_points(bending_nodes)?;
        let like = like.map(template).transpose()?;
        let found = py.detach(|| {
            let (bending, progress) = (bending.as_deref(), Progress::default());
            match &like {
                Some(template) => self.0.preview_like(bending, template, &progress.whole()),
                None => self.0.sections(bending, &progress.whole()),
            }
        });
        let found = found.or_raise()?;
        section_list(py, &found)
    }

    /// The skeleton as it is used, arc after arc.
    #[getter]
    fn arcs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for arc in self.0.arcs() {
            let entry = PyDict::new(py);
            entry.set_item("path", arrays::from_points(py, &arc.path)?)?;
            let nodes = arc.nodes.iter().map(|node| node.map_or(-1, |node| node as i64));
            entry.set_item("nodes", PyArray1::from_iter(py, nodes))?;
            list.append(entry)?;
        }
        Ok(list)
    }

    /// What was done to the skin.
    #[getter]
    fn repairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        repairs_dict(py, &self.0.repairs())
    }

    /// Begins to fit a rough cage, as fit_cage, in a thread of its own.
    fn fit(&self, cage_vertices: &Bound<'_, PyAny>, cage_faces: &Bound<'_, PyAny>) -> PyResult<CagingJob> {
        let (generator, rough) = (Arc::clone(&self.0), rough_cage(cage_vertices, cage_faces)?);
        CagingJob::start(move |progress| generator.fit(&rough, &progress.whole()))
    }

    /// Begins the cage in a thread of its own. `earlier`: bending nodes (or None), vertices (#C, 3) and
    /// faces of a cage of the same skin, skeleton and options; what it has around nodes that are still
    /// there stays. `like` as in generate_cage; `arrangement`: of the report of an earlier cage that was like
    /// another one.
    #[pyo3(signature = (bending_nodes=None, earlier=None, *, like=None, arrangement=None))]
    fn generate(
        &self,
        bending_nodes: Option<&Bound<'_, PyAny>>,
        earlier: Option<EarlierCage<'_>>,
        like: Option<LikeCage<'_>>,
        arrangement: Option<Vec<i64>>,
    ) -> PyResult<CagingJob> {
        let bending = bending_points(bending_nodes)?;
        let read = |(bending, vertices, faces): EarlierCage<'_>| -> PyResult<Earlier> {
            let vertices = arrays::points(&vertices, "earlier vertices", ("#C", None))?;
            let faces = arrays::polygons(&faces, "earlier faces")?;
            let bending = bending_points(bending.as_ref())?;
            Ok(Earlier { bending, vertices, faces, arrangement: arrangement.clone() })
        };
        let earlier = earlier.map(read).transpose()?;
        let generator = Arc::clone(&self.0);
        let like = like.map(template).transpose()?;
        CagingJob::start(move |progress| match &like {
            Some(template) => {
                generator.generate_like(bending.as_deref(), template, earlier.as_ref(), &progress.whole())
            }
            None => generator.generate(bending.as_deref(), earlier.as_ref(), &progress.whole()),
        })
    }
}

/// Makes a rough cage (cage_vertices (#C, 3), cage_faces) enclose a closed skin without crossing it, and draws it
/// tight: its vertices, its faces, index for index, and a report. What else is as in generate_cage.
#[pyfunction]
#[pyo3(signature = (vertices, faces, nodes, edges, cage_vertices, cage_faces, *, options=None, progress=None))]
#[allow(clippy::too_many_arguments)] // the names are keywords in Python
fn fit_cage<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    nodes: &Bound<'py, PyAny>,
    edges: &Bound<'py, PyAny>,
    cage_vertices: &Bound<'py, PyAny>,
    cage_faces: &Bound<'py, PyAny>,
    options: Option<&Bound<'py, PyDict>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let input = Input::read([vertices, faces], [nodes, edges], options)?;
    let rough = rough_cage(cage_vertices, cage_faces)?;
    let job = CagingJob::start(move |progress| input.generator()?.fit(&rough, &progress.whole()))?;
    job.watched(py, progress)
}

fn rough_cage(vertices: &Bound<'_, PyAny>, faces: &Bound<'_, PyAny>) -> PyResult<RoughCage> {
    let vertices = arrays::points(vertices, "cage_vertices", ("#C", None))?;
    Ok(RoughCage { vertices, faces: arrays::polygons(faces, "cage_faces")? })
}

/// Builds a cage around a closed skin (vertices (#V, 3), faces) from its skeleton (nodes (#N, 3),
/// edges (#E, 2)). Returns its vertices, its faces (corner indices, face sizes), and a report. `like`:
/// vertices (#C, 3), faces, and vertices of a cross section of a generated cage whose faces it takes over,
/// index for index.
#[pyfunction]
#[pyo3(signature = (vertices, faces, nodes, edges, *, bending_nodes=None, options=None, like=None, progress=None))]
#[allow(clippy::too_many_arguments)] // the names are keywords in Python
fn generate_cage<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
    nodes: &Bound<'py, PyAny>,
    edges: &Bound<'py, PyAny>,
    bending_nodes: Option<&Bound<'py, PyAny>>,
    options: Option<&Bound<'py, PyDict>>,
    like: Option<LikeCage<'py>>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyTuple>> {
    let job = CagingJob::new(vertices, faces, nodes, edges, bending_nodes, options, like)?;
    job.watched(py, progress)
}

fn cage_tuple<'py>(py: Python<'py>, found: &GeneratedCage) -> PyResult<Bound<'py, PyTuple>> {
    let GeneratedCage { vertices, faces, report } = found;
    let sizes: Vec<i64> = faces.sizes.iter().map(|s| *s as i64).collect();
    let corners = PyArray1::from_slice(py, &faces.corners);
    let vertices = arrays::from_points(py, vertices)?;
    if sizes.iter().all(|s| *s == 3) {
        let triangles = corners.reshape([sizes.len(), 3])?;
        return (vertices, triangles, report_dict(py, report)?).into_pyobject(py);
    }
    let faces = (corners, PyArray1::from_vec(py, sizes));
    (vertices, faces, report_dict(py, report)?).into_pyobject(py)
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
    CageGenerator::new(py, vertices, faces, nodes, edges, options)?.sections(py, bending_nodes, None)
}

/// A curve skeleton for a closed skin that has none: its nodes (#N, 3) and edges (#E, 2).
#[pyfunction]
fn extract_skeleton<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyTuple>> {
    let vertices = arrays::points(vertices, "vertices", ("#V", None))?;
    let faces = arrays::polygons(faces, "faces")?;
    let found = py.detach(|| cage_rig::caging::extract_skeleton(&vertices, &faces)).or_raise()?;
    let edges = PyArray1::from_vec(py, found.edges.concat()).reshape([found.edges.len(), 2])?;
    (arrays::from_points(py, &found.nodes)?, edges).into_pyobject(py)
}

fn section_list<'py>(py: Python<'py>, sections: &[SectionReport]) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for section in sections {
        let entry = PyDict::new(py);
        entry.set_item("kind", if section.kind == NodeKind::Leaf { "leaf" } else { "bending" })?;
        entry.set_item("place", point(py, &section.place))?;
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
    found.set_item("kept_vertices", report.kept)?;
    found.set_item("dropped_nodes", report.dropped.clone())?;
    found.set_item("repairs", repairs_dict(py, &report.repairs)?)?;
    found.set_item("volume_ratio", report.volume_ratio)?;
    found.set_item("mean_distance", report.mean_distance)?;
    found.set_item("clearance", report.clearance)?;
    found.set_item("min_angle", report.min_angle)?;
    found.set_item("genus", report.genus)?;
    let arrangement = report.arrangement.as_ref().map(|arcs| PyArray1::from_slice(py, arcs));
    found.set_item("arrangement", arrangement)?;
    let mirror = report.mirror.as_ref().map(|m| PyArray1::from_iter(py, m.iter().map(|v| i64::from(*v))));
    found.set_item("mirror", mirror)?;
    let timings = PyDict::new(py);
    for (stage, seconds) in &report.timings {
        timings.set_item(stage, seconds)?;
    }
    found.set_item("timings", timings)?;
    Ok(found)
}

fn repairs_dict<'py>(py: Python<'py>, repairs: &Repairs) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("welded", repairs.welded)?;
    found.set_item("left_out", repairs.left_out)?;
    found.set_item("turned", repairs.turned)?;
    found.set_item("inside_out", repairs.inside_out)?;
    found.set_item("parts", repairs.parts)?;
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
    module.add_class::<CagingJob>()?;
    module.add_class::<CageGenerator>()?;
    module.add_function(wrap_pyfunction!(extract_skeleton, module)?)?;
    module.add_function(wrap_pyfunction!(generate_cage, module)?)?;
    module.add_function(wrap_pyfunction!(fit_cage, module)?)?;
    module.add_function(wrap_pyfunction!(cage_sections, module)?)
}
