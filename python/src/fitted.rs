//! A fit, with what it takes to compute with its model and its noise.

use std::sync::Arc;

use nalgebra::DMatrix;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use ramphold::app::FittedSession;
use ramphold::fit::{Fit, Observations, predict, predictions};
use ramphold::wrist::SimulatedTorque;

use crate::arrays::{matrix, vector};
use crate::background;
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

    /// The values of a channel of a trial, in the channel's unit.
    fn of_channel<'a>(&'a self, channel: usize, values: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let (own, scale) = match channel.checked_sub(1) {
            None => (self.observations.torque_of(values), 1.0),
            Some(place) => {
                (self.observations.further_of(place, values), self.observations.further[place].nm_per_unit)
            }
        };
        own.iter().map(move |value| value / scale)
    }

    fn check_channel(&self, channel: usize) -> PyResult<()> {
        let count = 1 + self.observations.further.len();
        if channel < count {
            Ok(())
        } else {
            Err(wrong_input(format!("channel at {channel}: expected less than {count}")))
        }
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

    /// Columns of the channels that were fitted: the torque, and the further channels that the session has.
    #[getter]
    fn channels(&self) -> Vec<&'static str> {
        let further = self.observations.further.iter().map(|own| own.channel.column());
        std::iter::once("torque_l_nm").chain(further).collect()
    }

    /// The channel at `channel` as it was fitted: trials by samples, in the channel's unit.
    fn measured<'py>(&self, py: Python<'py>, channel: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.check_channel(channel)?;
        let trials = self.observations.trials.iter();
        let values = trials.flat_map(|trial| self.of_channel(channel, &trial.measured_nm)).collect();
        matrix(py, values, self.observations.trials.len())
    }

    /// The same of the fitted model.
    fn predicted<'py>(
        &self,
        py: Python<'py>,
        channel: usize,
        independent: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.check_channel(channel)?;
        let fit = self.chosen(independent);
        let predicted = py.detach(|| predictions(&self.observations, fit));
        let values = predicted.iter().flat_map(|own| self.of_channel(channel, &own.torque_nm)).collect();
        matrix(py, values, predicted.len())
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

    /// Whether residuals are weighted by the noise that was measured in the holds.
    #[getter]
    fn is_weighted(&self) -> bool {
        self.independent.objective.whitening_matrix(self.observations.noise_index[0]).is_some()
    }

    /// Residuals of the trial of row `trial` at `points` parameter vectors of the model, one after the other, weighted by the noise:
    /// points by values. And their derivatives, points times values by parameters, where they are wanted.
    #[allow(clippy::type_complexity)]
    fn residuals<'py>(
        &self,
        py: Python<'py>,
        trial: usize,
        parameters: &Bound<'py, PyAny>,
        points: usize,
        derivatives: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Option<Bound<'py, PyArray2<f64>>>)> {
        self.check(trial)?;
        let count = self.independent.parameters[trial].len();
        let array = vector(parameters, "parameters")?;
        let flat = array.as_slice().map_err(|error| wrong_input(format!("parameters: {error}")))?;
        if points == 0 || flat.len() != points * count {
            return Err(wrong_input(format!(
                "parameters: {} values; expected {count} for each point: {}",
                flat.len(),
                self.parameter_names().join(", ")
            )));
        }
        let flat = flat.to_vec();
        let wanted: Vec<usize> = if derivatives { (0..count).collect() } else { Vec::new() };
        let (observations, fit) = (self.observations.clone(), self.independent.clone());
        let work = move || {
            let noise = observations.noise_index[trial];
            let (own, mut response) = (observations.subset(&[trial]), SimulatedTorque::default());
            predict(&own, &fit.kinds, &wanted, &vec![0; points], &flat, &mut response);
            let (rows, measured) = (own.rows(), &own.trials[0].measured_nm);
            let mut residuals = Vec::new();
            let mut slopes = Vec::new();
            for point in 0..points {
                let predicted = &response.torque_nm[point * rows..(point + 1) * rows];
                let left: Vec<f64> = measured.iter().zip(predicted).map(|(m, p)| m - p).collect();
                residuals.extend_from_slice(fit.objective.whiten(noise, &left).as_slice());
                if !wanted.is_empty() {
                    let own = &response.slopes[point * rows * count..(point + 1) * rows * count];
                    let own = -DMatrix::from_row_slice(rows, count, own);
                    // The crate's matrices lie column by column.
                    let weighted = fit.objective.whiten_columns(noise, &own).transpose();
                    slopes.extend_from_slice(weighted.as_slice());
                }
            }
            (residuals, slopes)
        };
        // One point is done before another thread would have begun it.
        let (residuals, slopes) =
            if points == 1 { py.detach(work) } else { background::run(py, None, move |_| work())? };
        let values = residuals.len() / points;
        let slopes = if derivatives { Some(matrix(py, slopes, points * values)?) } else { None };
        Ok((matrix(py, residuals, points)?, slopes))
    }
}
