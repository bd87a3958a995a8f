//! Long work in threads of its own, which can be watched, cancelled and waited for.
//!
//! A thread knows nothing of Python: it may outlive the interpreter, and is never joined. Dropping a
//! job cancels it; the thread stops at its next step and frees what it had made.

use crate::errors::raise;
use crate::input::{read_input, Given, Meshes};
use crate::rig::CoupledRig;
use cage_rig::skinning::SkinningMethod;
use cage_rig::{Error, Progress, Stage};
use pyo3::panic::PanicException;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::any::Any;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How often a wait looks whether the person at the terminal has had enough.
const PATIENCE: Duration = Duration::from_millis(100);

/// Why there is no result.
#[derive(Clone)]
enum Fault {
    Error(Error),
    Panic(String),
}

impl Fault {
    fn raise(self) -> PyErr {
        match self {
            Self::Error(error) => raise(error),
            Self::Panic(message) => PanicException::new_err(message),
        }
    }
}

type Outcome<T> = Option<Result<T, Fault>>;

/// What a thread and its job share.
struct Shared<T> {
    progress: Progress,
    outcome: Mutex<Outcome<T>>,
    done: AtomicBool,
    ended: Condvar,
}

impl<T> Shared<T> {
    fn outcome(&self) -> MutexGuard<'_, Outcome<T>> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self, outcome: &mut Outcome<T>, found: Result<T, Fault>) {
        *outcome = Some(found);
        self.done.store(true, Relaxed);
        self.ended.notify_all();
    }
}

/// Work in a thread, or done already.
pub(crate) struct Job<T>(Arc<Shared<T>>);

impl<T: Clone + Send + 'static> Job<T> {
    /// Starts `work` in a thread. `keep` makes its result take effect, where it was not cancelled until then.
    pub(crate) fn start<W: 'static>(
        work: impl FnOnce(&Progress) -> Result<W, Error> + Send + 'static,
        keep: impl FnOnce(W) -> T + Send + 'static,
    ) -> PyResult<Self> {
        let job = Self::new(None);
        let shared = Arc::clone(&job.0);
        thread::Builder::new().name("cage_rig".to_owned()).spawn(move || {
            let made = catch_unwind(AssertUnwindSafe(|| work(&shared.progress)));
            // From here on no cancel comes between.
            let mut outcome = shared.outcome();
            let found = match made {
                Err(panic) => Err(Fault::Panic(message_of(panic.as_ref()))),
                Ok(_) if shared.progress.is_cancelled() => Err(Fault::Error(cage_rig::Cancelled.into())),
                Ok(made) => made.map(keep).map_err(Fault::Error),
            };
            shared.end(&mut outcome, found);
        })?;
        Ok(job)
    }

    /// Nothing was left to do.
    fn ready(result: T) -> Self {
        Self::new(Some(Ok(result)))
    }

    fn new(outcome: Outcome<T>) -> Self {
        let done = AtomicBool::new(outcome.is_some());
        let (progress, ended) = (Progress::default(), Condvar::new());
        Self(Arc::new(Shared { progress, outcome: Mutex::new(outcome), done, ended }))
    }

    pub(crate) fn is_done(&self) -> bool {
        self.0.done.load(Relaxed)
    }

    pub(crate) fn share(&self) -> f64 {
        let kept = || matches!(*self.0.outcome(), Some(Ok(_)));
        if self.is_done() && kept() {
            1.0
        } else {
            self.0.progress.share()
        }
    }

    pub(crate) fn stage(&self) -> &'static str {
        self.0.progress.stage()
    }

    pub(crate) fn stages_from(&self, first: usize) -> Vec<Stage> {
        self.0.progress.stages_from(first)
    }

    /// Has no effect on what is done.
    pub(crate) fn cancel(&self, py: Python<'_>) {
        py.detach(|| {
            let outcome = self.0.outcome();
            if outcome.is_none() {
                self.0.progress.cancel();
            }
        });
    }

    /// Waits until it is done, or for so many seconds; returns whether it is done.
    pub(crate) fn wait(&self, py: Python<'_>, seconds: Option<f64>) -> PyResult<bool> {
        let limit = seconds.and_then(|s| Duration::try_from_secs_f64(s.max(0.0)).ok());
        let start = Instant::now();
        while !self.is_done() {
            let left = limit.map_or(PATIENCE, |limit| limit.saturating_sub(start.elapsed()));
            if left.is_zero() {
                return Ok(false);
            }
            py.detach(|| {
                let outcome = self.0.outcome();
                drop(self.0.ended.wait_timeout_while(outcome, left.min(PATIENCE), |found| found.is_none()));
            });
            py.check_signals()?;
        }
        Ok(true)
    }

    pub(crate) fn result(&self, py: Python<'_>) -> PyResult<T> {
        loop {
            self.wait(py, None)?;
            if let Some(found) = self.0.outcome().clone() {
                return found.map_err(Fault::raise);
            }
        }
    }

    pub(crate) fn describe(&self, what: &str) -> String {
        format!("<{what}: {:.0} %{}>", 100.0 * self.share(), if self.is_done() { ", done" } else { "" })
    }
}

impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.0.progress.cancel();
    }
}

fn message_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "panic".to_owned())
}

/// A bind in a thread of its own: takes what CoupledRig takes, and begins at once.
#[pyclass(frozen, module = "cage_rig_core")]
pub(crate) struct BindJob(Job<CoupledRig>);

#[pymethods]
impl BindJob {
    #[new]
    #[pyo3(signature = (skin_vertices, skin_faces, skin_weights, joints, parents, cage_vertices, cage_faces, *,
        method="lbs", coordinates="mean_value", anchors=None, cage_coords=None, joint_coords=None,
        center_coords=None, options=None))]
    #[allow(clippy::too_many_arguments)] // as of CoupledRig
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
        Ok(Self(Job::start(move |progress| cage_rig::CoupledRig::bind(input, progress), CoupledRig::of)?))
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

    /// The rig, once it is done; raises what the bind refuses.
    fn result(&self, py: Python<'_>) -> PyResult<CoupledRig> {
        self.0.result(py)
    }

    /// A job that panics: lets tests see that a panic stays an exception.
    #[staticmethod]
    #[allow(clippy::panic)]
    fn _panic_for_tests() -> PyResult<Self> {
        let work = |_: &Progress| -> Result<cage_rig::CoupledRig, Error> { panic!("asked to by a test") };
        Ok(Self(Job::start(work, CoupledRig::of)?))
    }

    fn __repr__(&self) -> String {
        self.0.describe("BindJob")
    }
}

/// A change of a rig's skinning method whose preparation runs in a thread of its own.
#[pyclass(frozen, module = "cage_rig_core")]
pub(crate) struct MethodJob {
    job: Job<()>,
    rig: CoupledRig,
    method: &'static SkinningMethod,
}

impl MethodJob {
    /// Begins to integrate the centers of rotation, where they are due.
    pub(crate) fn start(py: Python<'_>, rig: &CoupledRig, method: &'static SkinningMethod) -> PyResult<Self> {
        let due = rig.with(py, |rig| rig.due_centers(method))?;
        let target = rig.clone();
        let job = match due {
            None => Job::ready(()),
            Some(due) => Job::start(
                move |progress| Ok(due.integrate(&progress.whole())?),
                move |centers| target.take_centers(centers),
            )?,
        };
        Ok(Self { job, rig: rig.clone(), method })
    }
}

#[pymethods]
impl MethodJob {
    /// The name of the method that the rig is to have.
    #[getter]
    fn method(&self) -> &'static str {
        self.method.name
    }

    /// How much is done, 0 to 1. Never falls.
    #[getter]
    fn progress(&self) -> f64 {
        self.job.share()
    }

    /// What is being computed, for people; empty before it begins.
    #[getter]
    fn stage(&self) -> &'static str {
        self.job.stage()
    }

    /// Whether result() answers at once.
    #[getter]
    fn done(&self) -> bool {
        self.job.is_done()
    }

    /// Stops it soon, unless it is done: then result() raises Cancelled.
    fn cancel(&self, py: Python<'_>) {
        self.job.cancel(py);
    }

    /// Waits until it is done, or for so many seconds; returns whether it is done.
    #[pyo3(signature = (seconds=None))]
    fn wait(&self, py: Python<'_>, seconds: Option<f64>) -> PyResult<bool> {
        self.job.wait(py, seconds)
    }

    /// Once it is done, changes the method: until then the rig has the one that it had.
    fn result(&self, py: Python<'_>) -> PyResult<()> {
        self.job.result(py)?;
        self.rig.with(py, |rig| rig.set_method(self.method))
    }

    fn __repr__(&self) -> String {
        self.job.describe("MethodJob")
    }
}
