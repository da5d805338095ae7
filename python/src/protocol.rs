//! Protocols and schedules.

use std::path::PathBuf;

use pyo3::prelude::*;
use ramphold::protocol::ValidProtocol;
use ramphold::schedule;

use crate::errors::exception;

/// A protocol that passed every check.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeProtocol(pub ValidProtocol);

#[pymethods]
impl NativeProtocol {
    /// Reads a protocol file.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        ValidProtocol::read(&path).map(Self).map_err(exception)
    }

    /// Reads a protocol from its JSON text; `name` stands in messages.
    #[staticmethod]
    fn parse(text: &str, name: &str) -> PyResult<Self> {
        ValidProtocol::parse(text, name).map(Self).map_err(exception)
    }

    /// The JSON text.
    #[getter]
    fn text(&self) -> &str {
        self.0.text()
    }

    /// Number of trials that are analysed if none is rejected.
    #[getter]
    fn trial_count(&self) -> usize {
        self.0.trial_count()
    }

    /// The order of the trials: the text of schedule.csv.
    fn schedule(&self, seed: u64, subject_number: Option<u32>) -> PyResult<String> {
        let order = schedule::draw(&self.0, seed, subject_number).map_err(exception)?;
        let mut text = Vec::new();
        schedule::write_csv(&order, &mut text).map_err(exception)?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }
}
