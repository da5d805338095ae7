//! Projection of whitened residuals and changes onto what the free parameters of a fit cannot absorb: the complement of the tangent
//! space.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::evidence::angle_error::AngleErrors;
use crate::diagnose::evidence::size_drift::ConstantDrifts;
use crate::fit::{Component, Fit, Observations, Position, Prediction, Transform, predictions};

/// Residuals and tangent space of a fit, component by component.
pub struct ResidualProjection {
    parts: Vec<ProjectedComponent>,
    /// Number of whitened values of each trial, and how many of them stand for coordinates with a prior.
    rows: Vec<usize>,
    known: Vec<usize>,
    /// Of known shape, so that all projected values are in units of the noise and these together.
    constant_drifts: SharedErrors,
    angle_errors: SharedErrors,
}

/// Errors that trials share, as independent directions of unit norm in all projected values. Each adds to the noise along its direction.
struct SharedErrors {
    /// For each trial, its part of each direction.
    directions: Vec<DMatrix<f64>>,
    /// What whitening takes off along each direction: 1 less the inverse of the standard deviation there.
    excess: DVector<f64>,
}

impl SharedErrors {
    fn none(trials: usize) -> Self {
        Self { directions: vec![DMatrix::zeros(0, 0); trials], excess: DVector::zeros(0) }
    }

    /// The errors whose projected effects are `effects`, for each error one of unit standard deviation.
    fn of(effects: &[WhitenedTrials], rows: &[usize]) -> Self {
        let none = Self::none(rows.len());
        if effects.is_empty() {
            return none;
        }
        let mut stacked = DMatrix::zeros(rows.iter().sum(), effects.len());
        for (mut column, effect) in stacked.column_iter_mut().zip(effects) {
            let mut first = 0;
            for own in effect {
                column.rows_mut(first, own.len()).copy_from(own);
                first += own.len();
            }
        }
        // Principal directions: eigenvectors of the small matrix of products.
        let eigen = (stacked.transpose() * &stacked).symmetric_eigen();
        let kept: Vec<usize> =
            (0..effects.len()).filter(|place| eigen.eigenvalues[*place] > SMALLEST_VARIANCE).collect();
        let variances =
            DVector::from_iterator(kept.len(), kept.iter().map(|place| eigen.eigenvalues[*place]));
        if kept.is_empty() {
            return none;
        }
        let mut directions = stacked * eigen.eigenvectors.select_columns(&kept);
        for (mut column, variance) in directions.column_iter_mut().zip(variances.iter()) {
            column /= libm::sqrt(*variance);
        }
        let mut first = 0;
        let own = |rows: &usize| {
            first += rows;
            directions.rows(first - rows, *rows).into_owned()
        };
        Self {
            directions: rows.iter().map(own).collect(),
            excess: variances.map(|variance| 1.0 - 1.0 / libm::sqrt(1.0 + variance)),
        }
    }

    /// `values` in units of the standard deviation of noise and errors together.
    fn whiten(&self, mut values: WhitenedTrials) -> WhitenedTrials {
        if self.excess.is_empty() {
            return values;
        }
        let mut along = DVector::zeros(self.excess.len());
        for (own, directions) in values.iter().zip(&self.directions) {
            along.gemv_tr(1.0, directions, own, 1.0);
        }
        along.component_mul_assign(&self.excess);
        for (own, directions) in values.iter_mut().zip(&self.directions) {
            own.gemv(-1.0, directions, &along, 1.0);
        }
        values
    }
}

/// Variance of an error's effect, by that of the noise, below which it is left out.
const SMALLEST_VARIANCE: f64 = 1e-6;

/// One component: trials that share parameters, block by block.
struct ProjectedComponent {
    trials: Vec<usize>,
    blocks: Vec<BlockBasis>,
    /// Orthonormal basis of the effects of the shared parameters, orthogonal to those of the blocks.
    border: DMatrix<f64>,
    /// Projected whitened residuals (measured less predicted).
    residual: DVector<f64>,
}

/// First row of a block, and an orthonormal basis of the effects of the block's parameters on its rows.
struct BlockBasis {
    first: usize,
    basis: DMatrix<f64>,
}

impl ProjectedComponent {
    /// Subtracts from `stacked` what the parameters can absorb.
    fn project(&self, stacked: &mut DVector<f64>) {
        for BlockBasis { first, basis } in &self.blocks {
            let mut own = stacked.rows_mut(*first, basis.nrows());
            own -= basis * basis.tr_mul(&own);
        }
        *stacked -= &self.border * self.border.tr_mul(stacked);
    }

    /// The part of `change` in these trials, projected.
    fn projected(&self, change: &WhitenedTrials, rows: &[usize]) -> DVector<f64> {
        let mut stacked = DVector::zeros(self.residual.len());
        let mut first = 0;
        for trial in &self.trials {
            stacked.rows_mut(first, change[*trial].len()).copy_from(&change[*trial]);
            first += rows[*trial];
        }
        self.project(&mut stacked);
        stacked
    }

    /// Lets the shared parameters absorb `directions` as well.
    fn absorb(&mut self, directions: &[WhitenedTrials], rows: &[usize]) {
        if directions.is_empty() {
            return;
        }
        let projected: Vec<DVector<f64>> = directions.iter().map(|own| self.projected(own, rows)).collect();
        let known = self.border.column_iter().map(|own| own.into_owned());
        let columns: Vec<DVector<f64>> = known.chain(projected).collect();
        self.border = orthonormal(DMatrix::from_columns(&columns));
        let mut residual = std::mem::replace(&mut self.residual, DVector::zeros(0));
        self.project(&mut residual);
        self.residual = residual;
    }

    fn parameters(&self) -> usize {
        self.blocks.iter().map(|block| block.basis.ncols()).sum::<usize>() + self.border.ncols()
    }
}

/// Whitened values, one vector per trial. Projected vectors lack the part that the free parameters can absorb, and end with the values
/// of the coordinates with a prior.
pub type WhitenedTrials = Vec<DVector<f64>>;

impl ResidualProjection {
    /// The tangent space of `fit` and of the `further` directions, and `constant_drifts` and `angle_errors` that trials share.
    pub fn new(
        observations: &Observations,
        fit: &Fit,
        further: &[WhitenedTrials],
        (constant_drifts, angle_errors): (&ConstantDrifts, &AngleErrors),
    ) -> Self {
        let predictions = predictions(observations, fit);
        let count = observations.trials.len();
        let known: Vec<Vec<usize>> = (0..count).map(|trial| known(fit, trial)).collect();
        let rows: Vec<usize> = (0..count)
            .map(|trial| {
                fit.objective.whitened_count(observations.noise_index[trial], observations.rows())
                    + known[trial].len()
            })
            .collect();
        let part = |component: &Component| {
            let mut part = ProjectedComponent::new(observations, fit, component, &predictions, &rows, &known);
            part.absorb(further, &rows);
            part
        };
        let parts = fit.parameterisation.components.iter().map(part).collect();
        let known = known.iter().map(Vec::len).collect();
        let [constants, angle] = [SharedErrors::none(count), SharedErrors::none(count)];
        let mut tangent = Self { parts, rows, known, constant_drifts: constants, angle_errors: angle };
        tangent.constant_drifts = tangent.shared(&constant_drifts.columns, &constant_drifts.variances);
        tangent.angle_errors = tangent.shared(&angle_errors.columns, &angle_errors.variances);
        tangent
    }

    /// Errors that trials share, whose effects are `columns` for each trial, as the projected values show them.
    fn shared(&self, columns: &[DMatrix<f64>], variances: &DVector<f64>) -> SharedErrors {
        let effect = |(place, variance): (usize, &f64)| {
            let sd = libm::sqrt(*variance);
            self.project(&columns.iter().map(|own| own.column(place) * sd).collect())
        };
        let effects: Vec<WhitenedTrials> = variances.iter().enumerate().map(effect).collect();
        SharedErrors::of(&effects, &self.rows)
    }

    /// The whitened residuals by trial, projected.
    pub fn residuals(&self) -> WhitenedTrials {
        self.constant_drifts.whiten(self.by_trial(|part| part.residual.clone()))
    }

    /// Subtracts from `change` what the free parameters can absorb, and weighs it by how far measured constants may drift.
    pub fn project(&self, change: &WhitenedTrials) -> WhitenedTrials {
        self.constant_drifts.whiten(self.by_trial(|part| part.projected(change, &self.rows)))
    }

    /// Projected `values` in units of the noise and the angle's errors together.
    pub fn whitened(&self, values: WhitenedTrials) -> WhitenedTrials {
        self.angle_errors.whiten(values)
    }

    /// Degrees of freedom of the residuals: number of values less number of parameters.
    pub fn freedom(&self) -> f64 {
        self.parts.iter().map(|part| part.residual.len() as f64 - part.parameters() as f64).sum()
    }

    /// Number of whitened torque values of a trial, without those of coordinates with a prior.
    pub fn torque_values(&self, trial: usize) -> usize {
        self.rows[trial] - self.known[trial]
    }

    fn by_trial(&self, stacked: impl Fn(&ProjectedComponent) -> DVector<f64>) -> WhitenedTrials {
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

impl ProjectedComponent {
    fn new(
        observations: &Observations,
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
                let white = fit.objective.whiten_columns(observations.noise_index[trial], slopes);
                let values = white.nrows();
                part.residual
                    .rows_mut(first, values)
                    .copy_from(&fit.objective.whiten(observations.noise_index[trial], residual_nm));
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
                        match component.position(block, coordinate) {
                            Some(Position::Block(place)) => {
                                let mut column = jacobian.view_mut((first - begin, place), (values, 1));
                                column += change;
                            }
                            Some(Position::Border(place)) => {
                                let mut column = part.border.view_mut((first, place), (values, 1));
                                column += change;
                            }
                            None => {}
                        }
                    });
                }
                first += rows[trial];
                part.trials.push(trial);
            }
            let basis = orthonormal(jacobian);
            let mut shared = part.border.rows_mut(begin, basis.nrows());
            shared -= &basis * basis.tr_mul(&shared);
            part.blocks.push(BlockBasis { first: begin, basis });
        }
        part.border = orthonormal(part.border);
        let mut residual = std::mem::replace(&mut part.residual, DVector::zeros(0));
        part.project(&mut residual);
        part.residual = residual;
        part
    }
}

/// An orthonormal basis of the span of the columns; columns that are nearly dependent on others are left out.
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

/// The coordinates of a trial's block that have a prior.
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
