//! The model as a function: torque and its derivatives for a motion of the motor.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use ramphold::fit::{EmgGaps, FrictionLaw, Observations, RigConstants, TrialObservation, predict};
use ramphold::rig::virtual_wrist::MechanismList;
use ramphold::signal::FilterSpec;
use ramphold::wrist::mechanisms::{CATALOGUE, Covariates, FREE_LAWS, MechanismKind};
use ramphold::wrist::{BASE_PARAMETERS, Lever, SimulatedTorque, Smoothing, TrialInput, motor_motion};
use serde::Deserialize;
use serde_json::json;

use crate::arrays::{matrix, vector};
use crate::background;
use crate::errors::wrong_input;
use crate::signals::argument;

/// Most samples of a motion.
const MAX_SAMPLES: usize = 10_000_000;

/// A motion of the motor, with the lever and the filter between the model's torque and the measured one.
#[pyclass(frozen, module = "ramphold._native")]
pub struct NativeMotion {
    /// One trial.
    observations: Arc<Observations>,
}

/// Settings of a motion that is given, not from a fit.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GivenMotion {
    sample_rate_hz: f64,
    onset: usize,
    window_s: f64,
    lever: Option<Lever>,
    filter: Option<FilterSpec>,
    velocity_rad_s: f64,
    torque_nm: f64,
    progress: f64,
    rest_s: f64,
    flexor_emg_excess_mvc: f64,
    extensor_emg_mvc: f64,
}

impl NativeMotion {
    /// The motion of the only trial of `observations`, whose torque is what is simulated.
    pub fn of(mut observations: Observations) -> PyResult<Self> {
        observations.further.clear();
        if observations.trials.len() == 1 {
            Ok(Self { observations: Arc::new(observations) })
        } else {
            Err(wrong_input("a motion is that of one trial"))
        }
    }

    fn trial(&self) -> &TrialObservation {
        &self.observations.trials[0]
    }
}

#[pymethods]
impl NativeMotion {
    /// The motion of a recorded angle `theta`, rad; `settings` is JSON.
    #[new]
    fn new(theta: &Bound<'_, PyAny>, settings: &str) -> PyResult<Self> {
        let given: GivenMotion = argument(settings, "motion")?;
        let array = vector(theta, "theta")?;
        let theta = array.as_slice().map_err(|error| wrong_input(format!("theta: {error}")))?;
        if let Some(sample) = theta.iter().position(|value| !value.is_finite()) {
            return Err(wrong_input(format!(
                "theta[{sample}]: {} is not valid; expected a finite number",
                theta[sample]
            )));
        }
        let rate = given.sample_rate_hz;
        let refuse = |field: &str, found: String, expected: &str| {
            Err(wrong_input(format!("{field}: {found} is not valid; expected {expected}")))
        };
        if !(rate > 0.0 && rate <= 1e6) {
            return refuse(
                "sample_rate_hz",
                rate.to_string(),
                "more than 0 and at most 1000000 samples a second",
            );
        }
        if !(given.window_s > 0.0 && given.window_s <= 10.0) {
            return refuse("window_s", given.window_s.to_string(), "more than 0 and at most 10 s");
        }
        if let Some(lever) = given.lever {
            let positive = |value: f64| value.is_finite() && value > 0.0;
            let damped = lever.damping_nm_s_per_rad.is_finite() && lever.damping_nm_s_per_rad >= 0.0;
            if !(damped && positive(lever.inertia_kg_m2) && positive(lever.stiffness_nm_per_rad)) {
                return refuse(
                    "lever",
                    format!("{lever:?}"),
                    "inertia and stiffness above 0, and a damping from 0 up",
                );
            }
        }
        let period_s = 1.0 / rate;
        let samples = (given.window_s * rate).round() as usize;
        let needed = given.onset.saturating_add(samples);
        if samples == 0 || theta.len() < needed.max(5) || theta.len() > MAX_SAMPLES {
            let expected = format!("onset and window, {}, up to {MAX_SAMPLES}", needed.max(5));
            return refuse("theta", format!("{} samples", theta.len()), &expected);
        }
        let sections = match given.filter {
            None => Vec::new(),
            Some(filter) => filter.sections(rate).map_err(|error| wrong_input(error.to_string()))?,
        };
        let covariates = Covariates {
            velocity_rad_s: given.velocity_rad_s,
            torque_before_nm: given.torque_nm,
            progress: given.progress,
            rest_s: given.rest_s,
            flexor_emg_excess_mvc: given.flexor_emg_excess_mvc,
            extensor_emg_mvc: given.extensor_emg_mvc,
        };
        let trial = TrialObservation {
            number: 1,
            condition: 0,
            label: None,
            repetition: 1,
            velocity_rad_s: given.velocity_rad_s,
            torque_nm: given.torque_nm,
            direction: 1.0,
            onset_s: given.onset as f64 * period_s,
            stated_late_s: 0.0,
            theta_0_rad: 0.0,
            torque_0_nm: given.torque_nm,
            angle_rad: theta.to_vec(),
            load_nm: vec![0.0; theta.len()],
            input: TrialInput { motion: motor_motion(theta, period_s), onset: given.onset, covariates },
            measured_nm: vec![0.0; samples],
            cubed_nm3: vec![0.0; samples],
            cubed_0_nm3: 0.0,
            friction: None,
            motion_errors: None,
            hold_stretches: Vec::new(),
        };
        Self::of(Observations {
            lever: given.lever,
            constants: RigConstants::stated(given.lever),
            friction_law: FrictionLaw::default(),
            period_s,
            samples,
            // The model starts at rest with the record.
            lead_samples: given.onset,
            filter: given.filter,
            prediction_sections: sections.clone(),
            sections,
            trials: vec![trial],
            excluded_trials: Vec::new(),
            emg_gaps: EmgGaps::default(),
            stride: 1,
            angle_noise_rad: 0.0,
            angle_step_rad: 0.0,
            angle_smoothings: vec![(1.0, Smoothing::ONE_RECORD)],
            further: Vec::new(),
            further_step: Vec::new(),
            noise_index: vec![None],
            noise_covariances: Vec::new(),
            noise_source: None,
        })
    }

    /// Number of samples of the window.
    #[getter]
    fn samples(&self) -> usize {
        self.observations.samples
    }

    /// Samples a second.
    #[getter]
    fn sample_rate_hz(&self) -> f64 {
        1.0 / self.observations.period_s
    }

    /// Angle (rad, a change from the hold) and speed (rad/s) of the motor in the window, at every sample from the onset on.
    fn window<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let input = &self.trial().input;
        let window = &input.motion[input.onset..input.onset + self.observations.samples];
        (
            PyArray1::from_iter(py, window.iter().map(|knot| knot.theta)),
            PyArray1::from_iter(py, window.iter().map(|knot| knot.omega)),
        )
    }

    /// Torque (points by samples, N m) at `points` parameter vectors of the base model, one after the other, and its derivatives
    /// (points times samples, by parameters) where they are wanted.
    #[allow(clippy::type_complexity)]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        parameters: &Bound<'py, PyAny>,
        points: usize,
        mechanisms: &str,
        derivatives: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Option<Bound<'py, PyArray2<f64>>>)> {
        let added: MechanismList = argument(mechanisms, "mechanisms")?;
        let array = vector(parameters, "parameters")?;
        let base = array.as_slice().map_err(|error| wrong_input(format!("parameters: {error}")))?;
        if points == 0 || base.len() != points * BASE_PARAMETERS.len() {
            let expected = "6 for each point: ".to_owned() + &BASE_PARAMETERS.join(", ");
            return Err(wrong_input(format!("parameters: {} values; expected {expected}", base.len())));
        }
        for (place, value) in base.iter().enumerate() {
            let name = BASE_PARAMETERS[place % BASE_PARAMETERS.len()];
            if !value.is_finite() || (name == "i_j_kg_m2" && *value <= 0.0) {
                let expected = if name == "i_j_kg_m2" { "an inertia above 0" } else { "a finite number" };
                return Err(wrong_input(format!(
                    "parameters, {name}: {value} is not valid; expected {expected}"
                )));
            }
        }
        for kind in &added.kinds {
            for need in kind.needs() {
                if let Some(reason) = need.unmet(self.observations.lever, &[self.trial().input.covariates])
                    && self.observations.lever.is_none()
                    && matches!(need, ramphold::wrist::mechanisms::DataRequirement::Lever)
                {
                    return Err(wrong_input(format!(
                        "mechanism {}: {reason}; expected a compliant lever",
                        kind.id()
                    )));
                }
            }
        }
        let count = BASE_PARAMETERS.len() + added.parameters.len();
        let flat: Vec<f64> = base
            .chunks_exact(BASE_PARAMETERS.len())
            .flat_map(|own| own.iter().chain(&added.parameters))
            .copied()
            .collect();
        let wanted: Vec<usize> = if derivatives { (0..count).collect() } else { Vec::new() };
        let observations = self.observations.clone();
        let samples = observations.samples;
        let work = move || {
            let mut response = SimulatedTorque::default();
            predict(&observations, &added.kinds, &wanted, &vec![0; points], &flat, &mut response);
            response
        };
        // One point is done before another thread would have begun it.
        let response =
            if points == 1 { py.detach(work) } else { background::run(py, None, move |_| work())? };
        if response.torque_nm.iter().any(|value| !value.is_finite()) {
            return Err(wrong_input(
                "the simulation does not stay finite at these parameters; expected values that a wrist can have",
            ));
        }
        let torque = matrix(py, response.torque_nm, points)?;
        let slopes = if derivatives { Some(matrix(py, response.slopes, points * samples)?) } else { None };
        Ok((torque, slopes))
    }
}

/// Every mechanism of the catalogue and every free law, as JSON.
#[pyfunction]
pub fn catalogue() -> String {
    let entry = |kind: &MechanismKind| {
        let parameters: Vec<_> = kind
            .parameters()
            .iter()
            .map(|own| {
                json!({
                    "name": own.name, "meaning": own.meaning, "low": own.low, "high": own.high,
                    "absent": own.absent, "typical": own.typical, "fitted": own.fitted,
                })
            })
            .collect();
        json!({
            "id": kind.id(), "title": kind.title(), "equation": kind.equation(), "source": kind.source(),
            "is_free_law": kind.is_free_law(), "parameters": parameters,
            "place": kind.law_space().place.id(), "argument": kind.law_space().argument.map(|own| own.id()),
        })
    };
    json!(CATALOGUE.iter().chain(FREE_LAWS).map(entry).collect::<Vec<_>>()).to_string()
}

/// The eight B-splines of a free law over `low` to `high` at the arguments `u`, each less its value at `rest`: arguments by splines.
#[pyfunction]
pub fn spline_basis<'py>(
    py: Python<'py>,
    u: &Bound<'py, PyAny>,
    low: f64,
    high: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let array = vector(u, "u")?;
    let u = array.as_slice().map_err(|error| wrong_input(format!("u: {error}")))?;
    if !(low.is_finite() && high.is_finite() && low < high) || u.iter().any(|value| !value.is_finite()) {
        return Err(wrong_input(format!(
            "range {low} to {high}: expected finite numbers, the lower one first"
        )));
    }
    let Some(law) = MechanismKind::from_id("free_joint_angle").and_then(MechanismKind::free_law) else {
        return Err(wrong_input("there is no free law"));
    };
    let count = law.coefficients.len();
    let unit = |k: usize| {
        let mut parameters = vec![0.0; law.coefficients.end];
        (parameters[0], parameters[1]) = (low, high);
        parameters[law.coefficients.start + k] = 1.0;
        parameters
    };
    let units: Vec<Vec<f64>> = (0..count).map(unit).collect();
    let values = u.iter().flat_map(|own| units.iter().map(|unit| law.curve(unit, *own))).collect();
    matrix(py, values, u.len().max(1))
}
