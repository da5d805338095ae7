//! What Python gives of trials: a description as JSON, and the signals of each trial by the names of the arguments.

use std::collections::BTreeMap;
use std::path::Path;

use pyo3::prelude::*;
use serde::de::DeserializeOwned;

use crate::arrays::vector;
use crate::errors::wrong_input;

/// The signals of a trial by the names of the arguments of `from_arrays`.
pub type Signals<'py> = BTreeMap<String, Bound<'py, PyAny>>;

/// The signals of a trial that has a name in messages.
pub struct TrialSignals<'a, 'py> {
    signals: &'a Signals<'py>,
    trial: String,
}

impl<'a, 'py> TrialSignals<'a, 'py> {
    /// The signals of the trial that messages call `trial`.
    pub fn new(signals: &'a Signals<'py>, trial: String) -> Self {
        Self { signals, trial }
    }

    /// A copy of a channel, if it is there.
    pub fn optional(&self, channel: &str) -> PyResult<Option<Vec<f64>>> {
        let Some(value) = self.signals.get(channel) else { return Ok(None) };
        let name = format!("{}, {channel}", self.trial);
        let array = vector(value, &name)?;
        let values = array.as_slice().map_err(|error| wrong_input(format!("{name}: {error}")))?;
        Ok(Some(values.to_vec()))
    }

    /// A copy of a channel that must be there.
    pub fn needed(&self, channel: &str) -> PyResult<Vec<f64>> {
        self.optional(channel)?.ok_or_else(|| wrong_input(format!("{}, {channel}: is missing", self.trial)))
    }
}

/// Whether the table has a row for each record.
pub fn check_rows(rows: usize, records: usize) -> PyResult<()> {
    if rows == records {
        return Ok(());
    }
    Err(wrong_input(format!("trials: {rows} rows; expected {records}, one for each record")))
}

/// Reads the JSON text of an argument.
pub fn argument<T: DeserializeOwned>(text: &str, name: &str) -> PyResult<T> {
    ramphold::json_file::parse(text, Path::new(name), "what the documentation describes")
        .map_err(|error| wrong_input(error.to_string()))
}
