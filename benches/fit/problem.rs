//! The problems that everybody solves: a session's prepared windows, the same starts, the same bounds.
//!
//! `weighed` is what the program fits, from the start that it finds. The plain sum of squares has flat valleys and many
//! optima that the noise does not tell apart, so `plain` starts near one of them, which the caller gives.

use std::path::Path;

use ramphold::dataset;
use ramphold::fit::{
    Fit, Model, Objective, Observations, Parameterisation, PreprocessingSettings, Solution, SolverOptions,
    StartingValueSearch, StartingValues, Transform, Weighting, solve,
};
use ramphold::wrist::{
    JOINT_DAMPING_NM_S_PER_RAD, Kinematics, Plant, SimulatedTorque, SimulationSettings, VectorWidth,
    YIELD_SMOOTHNESS_PER_NM, simulate, steps_per_sample, substeps,
};
use serde_json::{Value, json};

/// Where the plain problems start.
#[derive(serde::Deserialize)]
pub struct Starts {
    /// The first repetition's coordinates.
    pub repetition: Vec<f64>,
    /// The session's.
    pub session: Vec<f64>,
}

impl Starts {
    /// Reads `file`.
    pub fn read(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).expect("a file of starts");
        serde_json::from_str(&text).expect("starts")
    }
}

/// A session and the first values that the program finds for it.
pub struct Problem {
    /// The session's windows.
    pub prepared: Observations,
    /// Its fit, weighed by the noise of the holds.
    pub fit: Fit,
    starting_values: StartingValues,
}

/// Some trials of a session, a start, and what is to be minimised.
pub struct Part {
    prepared: Observations,
    parameterisation: Parameterisation,
    objective: Objective,
    start: Vec<f64>,
}

impl Problem {
    /// Reads and prepares the session in `folder`.
    pub fn read(folder: &Path) -> Self {
        let session = dataset::load(folder).expect("a session");
        let prepared =
            Observations::new(&session, PreprocessingSettings::default()).expect("trials that can be fitted");
        assert!(prepared.lever.is_some(), "the peers' model has a lever");
        // The steps of `Fit::new` before its multistart search.
        let search = StartingValueSearch::new(&prepared, Weighting::MeasuredNoise);
        let starting_values = search.starting_values(&prepared, &Model::paper()).swap_remove(0);
        let (weighed, covariances) =
            Objective::new(&prepared, Weighting::MeasuredNoise, Some(&starting_values.median_values()));
        let fit =
            Fit::from_starting_values(&prepared, &Model::paper(), weighed, covariances, &starting_values);
        Self { prepared, starting_values, fit }
    }

    /// All trials.
    pub fn all(&self) -> Vec<usize> {
        (0..self.prepared.trials.len()).collect()
    }

    /// Those of the first repetition.
    pub fn repetition(&self) -> Vec<usize> {
        self.all().into_iter().filter(|trial| self.prepared.trials[*trial].repetition == 1).collect()
    }

    /// The weighed problem of some trials, from the program's own start.
    pub fn weighed(&self, trials: &[usize]) -> Part {
        let prepared = self.prepared.subset(trials);
        let parameterisation =
            Parameterisation::new(&prepared, &Model::paper(), &self.starting_values.subset(trials));
        let start = parameterisation.start();
        Part { prepared, parameterisation, objective: self.fit.objective.clone(), start }
    }

    /// The plain problem of some trials, from `start`, or from the program's own where that is absent.
    pub fn plain(&self, trials: &[usize], start: Option<&Vec<f64>>) -> Part {
        let part = Part { objective: Objective::LeastSquares, ..self.weighed(trials) };
        match start {
            Some(start) => Part { start: start.clone(), ..part },
            None => part,
        }
    }

    /// Each trial's parameters at the program's own start.
    pub fn start_parameters(&self) -> Vec<Vec<f64>> {
        let part = self.weighed(&self.all());
        let own = |trial| {
            let mut parameters = Vec::new();
            part.parameterisation.parameters(trial, &part.start, &mut parameters);
            parameters
        };
        self.all().into_iter().map(own).collect()
    }

    /// A simulation of the session's windows, with derivatives for the parameters `wanted`.
    pub fn request<'a>(&'a self, width: VectorWidth, wanted: &'a [usize]) -> SimulationSettings<'a> {
        SimulationSettings { derivatives: wanted, width, ..self.prepared.request(&[], self.steps()) }
    }

    /// Steps a sample that the fit takes at the start.
    fn steps(&self) -> usize {
        let Observations { lever, period_s, trials, .. } = &self.prepared;
        let own = self.start_parameters();
        let steps = trials.iter().zip(&own);
        let steps = steps.map(|(trial, own)| steps_per_sample(*lever, &[], &trial.input, own, *period_s));
        steps.max().unwrap_or(1)
    }

    /// Runge-Kutta steps a sample that the peers take.
    fn substeps(&self) -> usize {
        let period_s = self.prepared.period_s;
        let plant = |own: &Vec<f64>| Plant::base(self.prepared.lever, own);
        let steps = |own: &Vec<f64>| substeps(&plant(own), f64::INFINITY, period_s).next_power_of_two();
        self.start_parameters().iter().map(steps).max().unwrap_or(1)
    }

    /// What the model is driven by, and what it predicts at the start.
    pub fn windows_json(&self) -> Value {
        let prepared = &self.prepared;
        let lever = prepared.lever.expect("a lever");
        let parameters = self.start_parameters();
        let trials: Vec<_> = prepared.trials.iter().map(|trial| &trial.input).collect();
        let mut response = SimulatedTorque::default();
        let wanted = [0, 1, 2, 3, 4, 5];
        simulate(&self.request(VectorWidth::One, &wanted), &trials, &parameters.concat(), &mut response);
        json!({
            "lever": [lever.inertia_kg_m2, lever.damping_nm_s_per_rad, lever.stiffness_nm_per_rad],
            "joint_damping": JOINT_DAMPING_NM_S_PER_RAD,
            "smoothness": YIELD_SMOOTHNESS_PER_NM,
            "period_s": prepared.period_s,
            "lead": prepared.lead_samples,
            "samples": prepared.samples,
            "substeps": self.substeps(),
            "sections": prepared.sections.iter().map(|s| [&s.b[..], &s.a[..]].concat()).collect::<Vec<_>>(),
            "repetitions": prepared.trials.iter().map(|trial| trial.repetition).collect::<Vec<_>>(),
            "theta_rad": self.each_knot(|knot| knot.theta),
            "omega_rad_s": self.each_knot(|knot| knot.omega),
            "parameters": parameters,
            "torque_nm": response.torque_nm,
            "slopes": response.slopes,
        })
    }

    /// The motor's motion from `lead` samples before the onset to one after the window.
    fn each_knot(&self, value: impl Fn(&Kinematics<f64>) -> f64) -> Vec<Vec<f64>> {
        let (lead, samples) = (self.prepared.lead_samples, self.prepared.samples);
        let own = |input: &ramphold::wrist::TrialInput| {
            input.motion[input.onset - lead..=input.onset + samples].iter().map(&value).collect()
        };
        self.prepared.trials.iter().map(|trial| own(&trial.input)).collect()
    }
}

impl Part {
    /// Solves it as the program does.
    pub fn solve(&self) -> Solution {
        solve(
            &self.prepared,
            &self.parameterisation,
            &[],
            &self.objective,
            &self.start,
            SolverOptions::default(),
        )
    }

    /// Measured torque, coordinates (all of them logarithms), whiteners, and where ours ends.
    pub fn as_json(&self) -> Value {
        let coordinates = &self.parameterisation.coordinates;
        let solution = self.solve();
        json!({
            "measured_nm": measured(&self.prepared),
            "repetitions": self.prepared.trials.iter().map(|trial| trial.repetition).collect::<Vec<_>>(),
            "coordinate_of": self.parameterisation.transforms.iter().map(|links| places(links)).collect::<Vec<_>>(),
            "low": coordinates.iter().map(|c| c.low).collect::<Vec<_>>(),
            "high": coordinates.iter().map(|c| c.high).collect::<Vec<_>>(),
            "start": self.start,
            "whiteners": self.whiteners(),
            "ours": solution.outcomes.iter().map(|outcome| {
                json!({ "cost": outcome.cost, "steps": outcome.iterations, "stop": outcome.termination })
            }).collect::<Vec<_>>(),
        })
    }

    /// The matrix of each trial that makes its noise independent, row by row; `None` where all samples count alike.
    fn whiteners(&self) -> Option<Vec<Vec<Vec<f64>>>> {
        let Objective::Whitened(matrices) = &self.objective else { return None };
        let rows = |noise: &Option<usize>| {
            let matrix = &matrices[noise.expect("every trial has a hold")];
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
        };
        Some(self.prepared.noise_index.iter().map(rows).collect())
    }
}

/// The coordinates that a trial's parameters are.
fn places(links: &[Transform]) -> Vec<usize> {
    let place = |link: &Transform| match link {
        Transform::Logarithmic { coordinate, .. } => *coordinate,
        other => panic!("the peers know logarithmic coordinates only, not {other:?}"),
    };
    links.iter().map(place).collect()
}

/// The measured torque, trial by trial.
pub fn measured(prepared: &Observations) -> Vec<&Vec<f64>> {
    prepared.trials.iter().map(|trial| &trial.measured_nm).collect()
}
