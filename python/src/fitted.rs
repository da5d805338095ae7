//! A fit, with what it takes to compute with its model and its noise.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use ramphold::app::FittedSession;
use ramphold::fit::{Fit, Observations, predictions};

use crate::arrays::matrix;
use crate::errors::{failed_work, wrong_input};
use crate::motion::NativeMotion;

/// A fit of a session.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeFit {
    observations: Arc<Observations>,
    independent: Fit,
    together: Option<Fit>,
    json: String,
}

impl NativeFit {
    /// The fit with its results as text.
    pub fn new(fitted: FittedSession) -> PyResult<Self> {
        let json = serde_json::to_string_pretty(&fitted.results.json)
            .map_err(|error| failed_work(error.to_string()))?
            + "\n";
        Ok(Self {
            observations: Arc::new(fitted.observations),
            independent: fitted.independent,
            together: fitted.together.ok().map(|together| together.fit),
            json,
        })
    }

    fn chosen(&self, independent: bool) -> &Fit {
        self.together.as_ref().filter(|_| !independent).unwrap_or(&self.independent)
    }

    fn check(&self, trial: usize) -> PyResult<()> {
        let count = self.observations.trials.len();
        if trial < count {
            Ok(())
        } else {
            Err(wrong_input(format!("trial at {trial}: expected less than {count}")))
        }
    }
}

#[pymethods]
impl NativeFit {
    /// The text of fit.json, byte for byte.
    #[getter]
    fn json(&self) -> &str {
        &self.json
    }

    /// Numbers of the fitted trials, in the order of the rows of the arrays.
    #[getter]
    fn numbers(&self) -> Vec<u32> {
        self.observations.trials.iter().map(|trial| trial.number).collect()
    }

    /// Names of the parameters of a trial, in order.
    #[getter]
    fn parameter_names(&self) -> Vec<String> {
        self.independent.model.parameter_names()
    }

    /// Time after the onset, s.
    #[getter]
    fn time_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let times = (0..self.observations.samples).map(|sample| sample as f64 * self.observations.period_s);
        PyArray1::from_iter(py, times)
    }

    /// Measured torque as it was fitted: trials by samples, N m.
    #[getter]
    fn measured_nm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let trials = &self.observations.trials;
        matrix(py, trials.iter().flat_map(|trial| &trial.measured_nm).copied().collect(), trials.len())
    }

    /// Predicted torque: trials by samples, N m.
    fn predicted_nm<'py>(&self, py: Python<'py>, independent: bool) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let fit = self.chosen(independent);
        let predicted = py.detach(|| predictions(&self.observations, fit));
        let count = predicted.len();
        matrix(py, predicted.into_iter().flat_map(|own| own.torque_nm).collect(), count)
    }

    /// Parameters: trials by parameters.
    fn parameters<'py>(&self, py: Python<'py>, independent: bool) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let fit = self.chosen(independent);
        matrix(py, fit.parameters.iter().flatten().copied().collect(), fit.parameters.len())
    }

    /// The motion that drives the model in the trial of row `trial`.
    fn motion(&self, trial: usize) -> PyResult<NativeMotion> {
        self.check(trial)?;
        NativeMotion::of(self.observations.subset(&[trial]))
    }

    /// The matrix that whitens a residual of the trial of row `trial`: whitened values by samples; `None` if residuals are not weighted.
    fn whitening<'py>(&self, py: Python<'py>, trial: usize) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        self.check(trial)?;
        let Some(own) = self.independent.objective.whitening_matrix(self.observations.noise_index[trial])
        else {
            return Ok(None);
        };
        // The crate's matrices lie column by column.
        matrix(py, own.transpose().as_slice().to_vec(), own.nrows()).map(Some)
    }
}
