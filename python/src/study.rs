//! Studies of many subjects: all at once, or part by part on the workers of a cluster.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use ramphold::app::Failure;
use ramphold::study::{SessionStorage, Study, StudyError, StudyFolder, StudyPart};
use rayon::prelude::*;

use crate::background;
use crate::errors::{exception, wrong_input};

/// A study with everything that its file names read and checked.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeStudy(Arc<Study>);

#[pymethods]
impl NativeStudy {
    /// Reads a study file and every file that it names.
    #[new]
    fn new(path: PathBuf, seed: u64) -> PyResult<Self> {
        Ok(Self(Arc::new(Study::open(&path, seed).map_err(exception)?)))
    }

    /// Name of the study.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// Number of sessions.
    #[getter]
    fn units(&self) -> u64 {
        self.0.units()
    }

    /// Number of parts.
    #[getter]
    fn parts(&self) -> u64 {
        self.0.parts()
    }

    /// Begins the study in the folder `out`, or goes on with it there.
    fn begin(&self, out: PathBuf, resume: bool) -> PyResult<()> {
        StudyFolder::open(&out, &self.0, resume).map(drop).map_err(exception)
    }

    /// Numbers of the parts in `out` that are not complete.
    fn pending(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<u64>> {
        let study = self.0.clone();
        let pending = background::run(py, None, move |_| -> Result<Vec<u64>, StudyError> {
            let folder = StudyFolder::open(&out, &study, true)?;
            Ok(folder.pending_parts(&study).iter().map(|part| part.number).collect())
        })?;
        pending.map_err(exception)
    }

    /// Computes the parts `numbers` in `out`; `listener` is called after each session, with nothing of meaning.
    fn compute(
        &self,
        py: Python<'_>,
        out: PathBuf,
        numbers: Vec<u64>,
        listener: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        if let Some(number) = numbers.iter().find(|number| **number >= self.0.parts()) {
            let last = self.0.parts().saturating_sub(1);
            return Err(wrong_input(format!(
                "part {number}: expected 0 to {last}, the last part of this study"
            )));
        }
        let study = self.0.clone();
        let done = background::run(py, listener, move |progress| -> Result<(), Failure> {
            let folder = StudyFolder::open(&out, &study, true)?;
            numbers.par_iter().try_for_each(|number| {
                let part = StudyPart::of(folder.path(), *number);
                if progress.is_interrupted() || part.is_done(&study) {
                    return Ok(());
                }
                part.run(&study, SessionStorage::Memory, || progress.stage("session"))
            })?;
            Ok(())
        })?;
        done.map_err(exception)
    }

    /// Makes the tables from the parts in `out`; returns the sessions that are not in them, as text.
    fn tables(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<String>> {
        let study = self.0.clone();
        let made = background::run(py, None, move |_| -> Result<Vec<String>, Failure> {
            let folder = StudyFolder::open(&out, &study, true)?;
            let (summary, _) = folder.write_tables(&study)?;
            Ok(summary.issues.iter().map(ToString::to_string).collect())
        })?;
        made.map_err(exception)
    }
}
