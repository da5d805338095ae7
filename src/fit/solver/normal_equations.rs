//! Cost, gradient and Gauss-Newton matrix of a component, kept in arrowhead form.

use nalgebra::{DMatrix, DVector};

use super::levenberg_marquardt::factor;
use crate::fit::data::preprocessing::Observations;
use crate::fit::parameters::parameterisation::{BorderPrior, Component, Parameterisation};
use crate::fit::residuals::prediction::predict;
use crate::wrist::SimulatedTorque;
use crate::wrist::mechanisms::MechanismKind;

/// What is minimised.
#[derive(Debug, Clone)]
pub enum Objective {
    /// The sum of squared torque residuals (section 2.4 of the paper).
    LeastSquares,
    /// The same after a matrix, one a noise of the session, has made the noise independent and of variance one.
    Whitened(Vec<DMatrix<f64>>),
}

/// One trial's part of the normal equations, by the estimated parameters.
#[derive(Debug, Clone)]
pub struct TrialNormalEquations {
    /// Sum of products of derivatives.
    pub matrix: DMatrix<f64>,
    /// Sum of derivatives times residual (predicted less measured).
    pub gradient: DVector<f64>,
    /// Half the sum of squares.
    pub cost: f64,
}

/// The part of a component's normal equations that belongs to one block.
#[derive(Debug, Clone)]
struct Block {
    cost: f64,
    matrix: DMatrix<f64>,
    with_border: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Its share of the border's.
    share: DMatrix<f64>,
    gradient_share: DVector<f64>,
}

/// The normal equations of a component.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// Half the sum of squares.
    pub cost: f64,
    blocks: Vec<Block>,
    border: DMatrix<f64>,
    border_gradient: DVector<f64>,
}

/// The normal equations of `components` at `coordinates`.
pub fn evaluate(
    observations: &Observations,
    parameterisation: &Parameterisation,
    kinds: &[MechanismKind],
    objective: &Objective,
    components: &[&Component],
    coordinates: &[f64],
) -> Vec<NormalEquations> {
    let trials: Vec<usize> = components.iter().flat_map(|component| &component.trials).copied().collect();
    let mut parameters = Vec::new();
    for trial in &trials {
        parameterisation.parameters(*trial, coordinates, &mut parameters);
    }
    let mut response = SimulatedTorque::default();
    predict(observations, kinds, &parameterisation.estimated, &trials, &parameters, &mut response);
    let mut place = 0;
    let count = parameterisation.transforms[0].len();
    let mut result = Vec::with_capacity(components.len());
    for component in components {
        let mut normal = NormalEquations::empty(component);
        for (own, trial) in component.trials.iter().enumerate() {
            let part = trial_normal(
                observations,
                objective,
                *trial,
                &response,
                place,
                parameterisation.estimated.len(),
            );
            let parameters = &parameters[place * count..(place + 1) * count];
            normal.add(component, parameterisation, own, *trial, parameters, &part);
            place += 1;
        }
        normal.add_priors(component, parameterisation, coordinates);
        normal.add_border_prior(component, coordinates);
        result.push(normal);
    }
    result
}

/// Residuals (predicted less measured) and derivatives of the trial at `place` in the response.
fn trial_normal(
    observations: &Observations,
    objective: &Objective,
    trial: usize,
    response: &SimulatedTorque,
    place: usize,
    wanted: usize,
) -> TrialNormalEquations {
    let samples = observations.samples;
    let torque = &response.torque_nm[place * samples..(place + 1) * samples];
    let slopes = &response.slopes[place * samples * wanted..(place + 1) * samples * wanted];
    let residual: Vec<f64> = torque
        .iter()
        .zip(&observations.trials[trial].measured_nm)
        .map(|(predicted, measured)| predicted - measured)
        .collect();
    match (objective, observations.noise_index[trial]) {
        (Objective::Whitened(whiteners), Some(noise)) => {
            let whitener = &whiteners[noise];
            let jacobian = whitener * DMatrix::from_row_slice(samples, wanted, slopes);
            let residual = whitener * DVector::from_vec(residual);
            TrialNormalEquations {
                cost: 0.5 * residual.norm_squared(),
                gradient: jacobian.tr_mul(&residual),
                matrix: jacobian.tr_mul(&jacobian),
            }
        }
        _ => {
            let mut matrix = DMatrix::zeros(wanted, wanted);
            let mut gradient = DVector::zeros(wanted);
            let mut cost = 0.0;
            for (row, residual) in slopes.chunks_exact(wanted.max(1)).zip(&residual) {
                for a in 0..wanted {
                    gradient[a] += row[a] * residual;
                    for b in 0..=a {
                        matrix[(a, b)] += row[a] * row[b];
                    }
                }
            }
            for residual in &residual {
                cost += 0.5 * residual * residual;
            }
            matrix.fill_upper_triangle_with_lower_triangle();
            TrialNormalEquations { matrix, gradient, cost }
        }
    }
}

impl NormalEquations {
    fn empty(component: &Component) -> Self {
        let border = component.border.len();
        Self {
            cost: 0.0,
            blocks: component
                .blocks
                .iter()
                .map(|own| Block {
                    cost: 0.0,
                    matrix: DMatrix::zeros(own.len(), own.len()),
                    with_border: DMatrix::zeros(own.len(), border),
                    gradient: DVector::zeros(own.len()),
                    share: DMatrix::zeros(border, border),
                    gradient_share: DVector::zeros(border),
                })
                .collect(),
            border: DMatrix::zeros(border, border),
            border_gradient: DVector::zeros(border),
        }
    }

    /// Adds a trial's part.
    fn add(
        &mut self,
        component: &Component,
        parameterisation: &Parameterisation,
        own: usize,
        trial: usize,
        parameters: &[f64],
        part: &TrialNormalEquations,
    ) {
        let block_index = component.block_of_trial[own];
        // The trial's parameters as places in the block or in the border, with how they change.
        let mut places: Vec<(usize, Result<usize, usize>, f64)> =
            Vec::with_capacity(parameterisation.estimated.len());
        for (row, parameter) in parameterisation.estimated.iter().enumerate() {
            parameterisation.slopes(trial, *parameter, parameters[*parameter], |coordinate, slope| {
                let place = match component.blocks[block_index].iter().position(|c| *c == coordinate) {
                    Some(place) => Ok(place),
                    None => Err(component.border.iter().position(|c| *c == coordinate).unwrap_or(0)),
                };
                places.push((row, place, slope));
            });
        }
        self.cost += part.cost;
        let Block { cost, matrix: block, with_border, gradient, share, gradient_share } =
            &mut self.blocks[block_index];
        *cost += part.cost;
        for (row, place, slope) in &places {
            match place {
                Ok(place) => gradient[*place] += slope * part.gradient[*row],
                Err(place) => {
                    self.border_gradient[*place] += slope * part.gradient[*row];
                    gradient_share[*place] += slope * part.gradient[*row];
                }
            }
            for (other_row, other_place, other_slope) in &places {
                let value = slope * other_slope * part.matrix[(*row, *other_row)];
                match (place, other_place) {
                    (Ok(a), Ok(b)) => block[(*a, *b)] += value,
                    (Ok(a), Err(b)) => with_border[(*a, *b)] += value,
                    (Err(_), Ok(_)) => {}
                    (Err(a), Err(b)) => {
                        self.border[(*a, *b)] += value;
                        share[(*a, *b)] += value;
                    }
                }
            }
        }
    }

    /// Adds what is known of the coordinates beforehand.
    fn add_priors(&mut self, component: &Component, parameterisation: &Parameterisation, at: &[f64]) {
        let known = |coordinate: &usize| {
            let (centre, sd) = parameterisation.coordinates[*coordinate].prior?;
            Some(((at[*coordinate] - centre) / sd, sd))
        };
        for (own, block) in component.blocks.iter().zip(&mut self.blocks) {
            for (place, coordinate) in own.iter().enumerate() {
                if let Some((away, sd)) = known(coordinate) {
                    self.cost += 0.5 * away * away;
                    block.cost += 0.5 * away * away;
                    block.gradient[place] += away / sd;
                    block.matrix[(place, place)] += 1.0 / (sd * sd);
                }
            }
        }
        for (place, coordinate) in component.border.iter().enumerate() {
            if let Some((away, sd)) = known(coordinate) {
                self.cost += 0.5 * away * away;
                self.border_gradient[place] += away / sd;
                self.border[(place, place)] += 1.0 / (sd * sd);
            }
        }
    }

    /// Adds what trials outside of the component know of its border.
    fn add_border_prior(&mut self, component: &Component, at: &[f64]) {
        let Some(known) = &component.border_prior else { return };
        let away = DVector::from_fn(component.border.len(), |i, _| at[component.border[i]] - known.at[i]);
        let slope = &known.information * &away;
        self.cost += known.gradient.dot(&away) + 0.5 * slope.dot(&away);
        self.border_gradient += &known.gradient + slope;
        self.border += &known.information;
    }

    /// What everything but one block knows of the border: the quadratic that is left when the other blocks follow.
    pub fn border_prior_from_others(&self, component: &Component, block: usize, at: &[f64]) -> BorderPrior {
        let mut information = &self.border - &self.blocks[block].share;
        let mut gradient = &self.border_gradient - &self.blocks[block].gradient_share;
        for (index, other) in self.blocks.iter().enumerate() {
            if index == block || other.matrix.nrows() == 0 {
                continue;
            }
            let mut matrix = other.matrix.clone();
            for i in 0..matrix.nrows() {
                matrix[(i, i)] = matrix[(i, i)] * (1.0 + 1e-9) + f64::MIN_POSITIVE;
            }
            let Some(factor) = factor(matrix) else { continue };
            information -= other.with_border.tr_mul(&factor.solve(&other.with_border));
            gradient -= other.with_border.tr_mul(&factor.solve(&other.gradient));
        }
        let at = DVector::from_iterator(component.border.len(), component.border.iter().map(|i| at[*i]));
        BorderPrior { at, gradient, information }
    }

    /// Standard deviations of a block's coordinates, the border being as well known as `known` and the block itself tell;
    /// infinite where nothing does.
    pub fn block_standard_deviations(&self, block: usize, known: &BorderPrior) -> Vec<f64> {
        let Block { matrix, with_border, share, .. } = &self.blocks[block];
        let (own, border) = (matrix.nrows(), share.nrows());
        let mut whole = DMatrix::zeros(own + border, own + border);
        whole.view_mut((0, 0), (own, own)).copy_from(matrix);
        whole.view_mut((0, own), (own, border)).copy_from(with_border);
        whole.view_mut((own, 0), (border, own)).copy_from(&with_border.transpose());
        whole.view_mut((own, own), (border, border)).copy_from(&(share + &known.information));
        match crate::fit::fitted::uncertainty::invert_scaled(whole) {
            Some(inverse) => (0..own).map(|i| libm::sqrt(inverse[(i, i)])).collect(),
            None => vec![f64::INFINITY; own],
        }
    }

    /// The gradient in the component's order.
    pub fn gradient(&self, component: &Component) -> DVector<f64> {
        let blocks = self.blocks.iter().flat_map(|block| block.gradient.iter());
        let values = blocks.chain(self.border_gradient.iter()).copied();
        DVector::from_iterator(component.order().len(), values)
    }

    /// The Levenberg-Marquardt step, `held` coordinates staying; `None` if the damped matrix is singular. `dampings` has one a
    /// block, the border's last.
    pub fn damped_step(
        &self,
        component: &Component,
        parameterisation: &Parameterisation,
        dampings: &[f64],
        held: &[bool],
    ) -> Option<DVector<f64>> {
        let border_start = held.len() - component.border.len();
        let border_held = &held[border_start..];
        let dampen = |matrix: &mut DMatrix<f64>, coordinates: &[usize], held: &[bool], damping: f64| {
            for (i, coordinate) in coordinates.iter().enumerate() {
                if held[i] {
                    matrix.row_mut(i).fill(0.0);
                    matrix.column_mut(i).fill(0.0);
                    matrix[(i, i)] = 1.0;
                } else {
                    // A floor under the diagonal keeps coordinates without influence where they are.
                    let scale = parameterisation.coordinates[*coordinate].scale;
                    let floor = 1e-9 * self.cost.max(1e-12) / (scale * scale);
                    matrix[(i, i)] += damping * matrix[(i, i)] + floor;
                }
            }
        };
        let mut border = self.border.clone();
        dampen(&mut border, &component.border, border_held, dampings[self.blocks.len()]);
        let mut right = -&self.border_gradient;
        for (i, held) in border_held.iter().enumerate() {
            if *held {
                right[i] = 0.0;
            }
        }
        let mut solved = Vec::with_capacity(self.blocks.len());
        let mut start = 0;
        for ((own, coordinates), damping) in self.blocks.iter().zip(&component.blocks).zip(dampings) {
            let own_held = &held[start..start + coordinates.len()];
            start += coordinates.len();
            let (mut block, mut with_border, mut gradient) =
                (own.matrix.clone(), own.with_border.clone(), -&own.gradient);
            dampen(&mut block, coordinates, own_held, *damping);
            for (i, held) in own_held.iter().enumerate() {
                if *held {
                    with_border.row_mut(i).fill(0.0);
                    gradient[i] = 0.0;
                }
            }
            for (j, held) in border_held.iter().enumerate() {
                if *held {
                    with_border.column_mut(j).fill(0.0);
                }
            }
            let factor = factor(block)?;
            let (across, own) = (factor.solve(&with_border), factor.solve(&gradient));
            border -= with_border.tr_mul(&across);
            right -= with_border.tr_mul(&own);
            solved.push((across, own));
        }
        let border_step = if right.is_empty() { right } else { factor(border)?.solve(&right) };
        let blocks =
            solved.iter().flat_map(|(across, own)| (own - across * &border_step).data.as_vec().clone());
        let step: Vec<f64> = blocks.chain(border_step.iter().copied()).collect();
        step.iter().all(|x| x.is_finite()).then(|| DVector::from_vec(step))
    }

    /// Decrease of the cost that the quadratic model promises for a step.
    pub fn predicted_decrease(
        &self,
        component: &Component,
        gradient: &DVector<f64>,
        step: &DVector<f64>,
    ) -> f64 {
        let border_start = step.len() - component.border.len();
        let border_step = step.rows(border_start, component.border.len());
        let mut curvature = (border_step.transpose() * &self.border * border_step)[(0, 0)];
        let mut start = 0;
        for Block { matrix, with_border, .. } in &self.blocks {
            let own = step.rows(start, matrix.nrows());
            start += matrix.nrows();
            curvature += own.dot(&(matrix * own)) + 2.0 * own.dot(&(with_border * border_step));
        }
        -gradient.dot(step) - 0.5 * curvature
    }

    /// What each block, with its share of the border, has in it.
    pub fn predicted_by_block(&self, step: &DVector<f64>) -> Vec<f64> {
        let border_start = step.len() - self.border.nrows();
        let border_step = step.rows(border_start, self.border.nrows());
        let mut start = 0;
        let promised = |own: &Block| {
            let mine = step.rows(start, own.matrix.nrows());
            start += own.matrix.nrows();
            let slope = own.gradient.dot(&mine) + own.gradient_share.dot(&border_step);
            let curvature = mine.dot(&(&own.matrix * mine))
                + 2.0 * mine.dot(&(&own.with_border * border_step))
                + border_step.dot(&(&own.share * border_step));
            -slope - 0.5 * curvature
        };
        self.blocks.iter().map(promised).collect()
    }

    /// The whole Gauss-Newton matrix in the component's order.
    pub fn dense(&self, component: &Component) -> DMatrix<f64> {
        let size = component.order().len();
        let border_start = size - component.border.len();
        let mut dense = DMatrix::zeros(size, size);
        let mut start = 0;
        for Block { matrix, with_border, .. } in &self.blocks {
            let (rows, columns) = (matrix.nrows(), with_border.ncols());
            dense.view_mut((start, start), (rows, rows)).copy_from(matrix);
            dense.view_mut((start, border_start), (rows, columns)).copy_from(with_border);
            dense.view_mut((border_start, start), (columns, rows)).copy_from(&with_border.transpose());
            start += rows;
        }
        dense.view_mut((border_start, border_start), self.border.shape()).copy_from(&self.border);
        dense
    }

    /// The cost of each block.
    pub fn block_costs(&self) -> impl Iterator<Item = f64> {
        self.blocks.iter().map(|block| block.cost)
    }

    /// The least cost of a block that the quadratic model promises with the border, and the block's coordinates in `held`, in
    /// place. What the data do not determine is damped, as in a first step of the descent.
    pub fn predicted_block_cost(&self, block: usize, held: &[bool]) -> f64 {
        let Block { cost, matrix, gradient, .. } = &self.blocks[block];
        let free: Vec<usize> = (0..held.len()).filter(|i| !held[*i]).collect();
        let mut own = DMatrix::from_fn(free.len(), free.len(), |i, j| matrix[(free[i], free[j])]);
        for i in 0..free.len() {
            own[(i, i)] = own[(i, i)] * (1.0 + 1e-3) + f64::MIN_POSITIVE;
        }
        let gradient = DVector::from_fn(free.len(), |i, _| gradient[free[i]]);
        factor(own).map_or(*cost, |factor| cost - 0.5 * gradient.dot(&factor.solve(&gradient)))
    }
}
