//! What the free parameters can and cannot absorb: the tangent space of a fit, in whitened units.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::predicted_torque::torques;
use crate::fit::{Component, Fit, Objective, Observations, Prediction, Transform, predictions};

/// A fit's residuals and tangent space, component by component.
pub struct Tangent {
    parts: Vec<Part>,
    /// Values a trial in whitened units, and how many of its coordinates are known beforehand: each is one more value.
    rows: Vec<usize>,
    known: Vec<usize>,
    /// What the encoder's rounding of the angle at rest may do to all trials alike: projected, and of length one.
    at_rest: Option<Direction>,
}

/// One component: trials that share parameters, block after block.
struct Part {
    trials: Vec<usize>,
    blocks: Vec<Block>,
    /// Orthonormal basis of what the parameters in common can do beyond those of the blocks.
    border: DMatrix<f64>,
    /// Whitened residuals (measured less predicted), less what the parameters could still do.
    residual: DVector<f64>,
}

/// The rows of a block's trials, and an orthonormal basis of what its own parameters can do to them.
struct Block {
    first: usize,
    basis: DMatrix<f64>,
}

impl Part {
    /// Takes away from `stacked` what the parameters can absorb.
    fn project(&self, stacked: &mut DVector<f64>) {
        for Block { first, basis } in &self.blocks {
            let mut own = stacked.rows_mut(*first, basis.nrows());
            own -= basis * basis.tr_mul(&own);
        }
        *stacked -= &self.border * self.border.tr_mul(stacked);
    }

    fn parameters(&self) -> usize {
        self.blocks.iter().map(|block| block.basis.ncols()).sum::<usize>() + self.border.ncols()
    }
}

/// A change of the predictions, whitened, one vector a trial. Projected ones lack the part that the free parameters can absorb,
/// and end with what the change would do to coordinates known beforehand.
pub type Direction = Vec<DVector<f64>>;

impl Tangent {
    /// The tangent space of `fit`.
    pub fn new(prepared: &Observations, fit: &Fit) -> Self {
        let predictions = predictions(prepared, fit);
        let count = prepared.trials.len();
        let known: Vec<Vec<usize>> = (0..count).map(|trial| known(fit, trial)).collect();
        let rows: Vec<usize> =
            (0..count).map(|trial| whiten_rows(prepared, fit, trial) + known[trial].len()).collect();
        let part = |component: &Component| Part::new(prepared, fit, component, &predictions, &rows, &known);
        let parts = fit.parameterisation.components.iter().map(part).collect();
        let known = known.iter().map(Vec::len).collect();
        let mut tangent = Self { parts, rows, known, at_rest: None };
        if prepared.angle_step_rad > 0.0 {
            let direction = tangent.project(&rounding_at_rest(prepared, fit));
            let length = libm::sqrt(direction.iter().map(DVector::norm_squared).sum());
            if length > 1e-6 {
                tangent.at_rest = Some(direction.into_iter().map(|own| own / length).collect());
            }
        }
        tangent
    }

    /// The whitened residuals by trial.
    pub fn residuals(&self) -> Direction {
        self.without_rounding(self.by_trial(|part| part.residual.clone()))
    }

    /// Takes away from `change` what the free parameters can absorb.
    pub fn project(&self, change: &Direction) -> Direction {
        let projected = self.by_trial(|part| {
            let mut stacked = DVector::zeros(part.residual.len());
            let mut first = 0;
            for trial in &part.trials {
                stacked.rows_mut(first, change[*trial].len()).copy_from(&change[*trial]);
                first += self.rows[*trial];
            }
            part.project(&mut stacked);
            stacked
        });
        self.without_rounding(projected)
    }

    fn without_rounding(&self, mut values: Direction) -> Direction {
        if let Some(at_rest) = &self.at_rest {
            let along: f64 = at_rest.iter().zip(&values).map(|(unit, own)| unit.dot(own)).sum();
            for (own, unit) in values.iter_mut().zip(at_rest) {
                *own -= along * unit;
            }
        }
        values
    }

    /// Values less parameters: the degrees of freedom of the residuals.
    pub fn freedom(&self) -> f64 {
        self.parts.iter().map(|part| part.residual.len() as f64 - part.parameters() as f64).sum()
    }

    /// The whitened values of a trial's torque, without those that stand for what is known beforehand.
    pub fn torque_values(&self, trial: usize) -> usize {
        self.rows[trial] - self.known[trial]
    }

    fn by_trial(&self, stacked: impl Fn(&Part) -> DVector<f64>) -> Direction {
        let mut result = vec![DVector::zeros(0); self.rows.len()];
        for part in &self.parts {
            let all = stacked(part);
            let mut first = 0;
            for trial in &part.trials {
                result[*trial] = all.rows(first, self.rows[*trial]).into_owned();
                first += self.rows[*trial];
            }
        }
        result
    }
}

impl Part {
    fn new(
        prepared: &Observations,
        fit: &Fit,
        component: &Component,
        predictions: &[Prediction],
        rows: &[usize],
        known: &[Vec<usize>],
    ) -> Self {
        let count: usize = component.trials.iter().map(|trial| rows[*trial]).sum();
        let mut part = Self {
            trials: Vec::new(),
            blocks: Vec::new(),
            border: DMatrix::zeros(count, component.border.len()),
            residual: DVector::zeros(count),
        };
        let mut first = 0;
        for (block, own) in component.blocks.iter().enumerate() {
            let begin = first;
            let trials: Vec<usize> = component.trials_of_block(block).collect();
            let mut jacobian = DMatrix::zeros(trials.iter().map(|trial| rows[*trial]).sum(), own.len());
            for trial in trials {
                let Prediction { jacobian: slopes, residual_nm, .. } = &predictions[trial];
                let white = whiten_matrix(prepared, fit, trial, slopes);
                let values = white.nrows();
                part.residual.rows_mut(first, values).copy_from(&whiten(prepared, fit, trial, residual_nm));
                for (row, coordinate) in known[trial].iter().enumerate() {
                    let (centre, sd) =
                        fit.parameterisation.coordinates[*coordinate].prior.unwrap_or((0.0, 1.0));
                    part.residual[first + values + row] =
                        (centre - fit.solution.coordinates[*coordinate]) / sd;
                    if let Some(place) = own.iter().position(|own| own == coordinate) {
                        jacobian[(first - begin + values + row, place)] = 1.0 / sd;
                    }
                }
                for (row, parameter) in fit.parameterisation.estimated.iter().enumerate() {
                    let value = fit.parameters[trial][*parameter];
                    fit.parameterisation.slopes(trial, *parameter, value, |coordinate, slope| {
                        let change = white.column(row) * slope;
                        if let Some(place) = own.iter().position(|own| *own == coordinate) {
                            let mut column = jacobian.view_mut((first - begin, place), (values, 1));
                            column += change;
                        } else if let Some(place) = component.border.iter().position(|own| *own == coordinate)
                        {
                            let mut column = part.border.view_mut((first, place), (values, 1));
                            column += change;
                        }
                    });
                }
                first += rows[trial];
                part.trials.push(trial);
            }
            let basis = orthonormal(jacobian);
            let mut shared = part.border.rows_mut(begin, basis.nrows());
            shared -= &basis * basis.tr_mul(&shared);
            part.blocks.push(Block { first: begin, basis });
        }
        part.border = orthonormal(part.border);
        let mut residual = std::mem::replace(&mut part.residual, DVector::zeros(0));
        part.project(&mut residual);
        part.residual = residual;
        part
    }
}

/// When the motor leaves the encoder step that it stood in, s after the onset, and when it is well out of it.
const LEAVES_S: (f64, f64) = (0.001, 0.004);

/// The change of the predictions if the angle at rest was rounded by one step: the motor comes back to the same place after
/// each trial, so that the error is the same in all of them and averages out in none.
fn rounding_at_rest(prepared: &Observations, fit: &Fit) -> Direction {
    let mut shifted = prepared.clone();
    for trial in &mut shifted.trials {
        let onset = trial.input.onset;
        for (sample, knot) in trial.input.motion.iter_mut().enumerate().skip(onset) {
            let time = (sample - onset) as f64 * prepared.period_s;
            let part = ((time - LEAVES_S.0) / (LEAVES_S.1 - LEAVES_S.0)).clamp(0.0, 1.0);
            let phase = std::f64::consts::PI * part;
            knot.theta += trial.direction * prepared.angle_step_rad * 0.5 * (1.0 - libm::cos(phase));
            knot.omega +=
                trial.direction * prepared.angle_step_rad * 0.5 * libm::sin(phase) * std::f64::consts::PI
                    / (LEAVES_S.1 - LEAVES_S.0);
        }
    }
    let before = torques(prepared, &fit.kinds, &fit.parameters);
    let after = torques(&shifted, &fit.kinds, &fit.parameters);
    (0..before.len())
        .map(|trial| {
            let change: Vec<f64> =
                after[trial].iter().zip(&before[trial]).map(|(to, from)| to - from).collect();
            whiten(prepared, fit, trial, &change)
        })
        .collect()
}

/// An orthonormal basis of the columns' span; columns that add next to nothing are left out.
fn orthonormal(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    for mut column in columns.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    if columns.ncols() == 0 {
        return columns;
    }
    let decomposed = columns.col_piv_qr();
    let (basis, triangle) = (decomposed.q(), decomposed.r());
    let largest = triangle[(0, 0)].abs();
    let rank =
        (0..triangle.nrows().min(triangle.ncols())).take_while(|i| triangle[(*i, *i)].abs() > 1e-6 * largest);
    basis.columns(0, rank.count()).into_owned()
}

/// The coordinates of a trial's own block that something is known of beforehand.
fn known(fit: &Fit, trial: usize) -> Vec<usize> {
    let mut known = Vec::new();
    for link in &fit.parameterisation.transforms[trial] {
        if let Transform::Logarithmic { coordinate, .. } = link
            && fit.parameterisation.coordinates[*coordinate].prior.is_some()
        {
            known.push(*coordinate);
        }
    }
    known
}

fn whiten_rows(prepared: &Observations, fit: &Fit, trial: usize) -> usize {
    match (&fit.objective, prepared.noise_index[trial]) {
        (Objective::Whitened(whiteners), Some(noise)) => whiteners[noise].nrows(),
        _ => prepared.samples,
    }
}

/// A trial's torques in units of its noise.
pub fn whiten(prepared: &Observations, fit: &Fit, trial: usize, torque_nm: &[f64]) -> DVector<f64> {
    let torque = DVector::from_column_slice(torque_nm);
    match (&fit.objective, prepared.noise_index[trial]) {
        (Objective::Whitened(whiteners), Some(noise)) => &whiteners[noise] * torque,
        _ => torque,
    }
}

fn whiten_matrix(prepared: &Observations, fit: &Fit, trial: usize, columns: &DMatrix<f64>) -> DMatrix<f64> {
    match (&fit.objective, prepared.noise_index[trial]) {
        (Objective::Whitened(whiteners), Some(noise)) => &whiteners[noise] * columns,
        _ => columns.clone(),
    }
}
