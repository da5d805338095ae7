//! Linear algebra on the arrowhead form of the normal equations: blocks are eliminated, and the Schur complement remains for the
//! border.

use nalgebra::{DMatrix, DVector};

use super::normal_equations::{BlockEquations, GaussNewtonEquations};
use crate::fit::linalg::{cholesky, invert_scaled};
use crate::fit::parameters::component::{BorderPrior, Component};
use crate::fit::parameters::parameterisation::Parameterisation;

impl GaussNewtonEquations {
    /// The gradient of the cost, in the order of the component.
    pub fn gradient(&self, component: &Component) -> DVector<f64> {
        let blocks = self.blocks.iter().flat_map(|block| block.gradient.iter());
        let values = blocks.chain(self.border_gradient.iter()).copied();
        DVector::from_iterator(component.order().len(), values)
    }

    /// The Gauss-Newton matrix, in the order of the component.
    pub fn dense(&self, component: &Component) -> DMatrix<f64> {
        let size = component.order().len();
        let border_start = size - component.border.len();
        let mut dense = DMatrix::zeros(size, size);
        let mut start = 0;
        for BlockEquations { matrix, with_border, .. } in &self.blocks {
            let (rows, columns) = (matrix.nrows(), with_border.ncols());
            dense.view_mut((start, start), (rows, rows)).copy_from(matrix);
            dense.view_mut((start, border_start), (rows, columns)).copy_from(with_border);
            dense.view_mut((border_start, start), (columns, rows)).copy_from(&with_border.transpose());
            start += rows;
        }
        dense.view_mut((border_start, border_start), self.border.shape()).copy_from(&self.border);
        dense
    }

    /// Calls `add` with each element of the Gauss-Newton matrix, by the indices of its coordinates. Those that a block and the border have
    /// in common come once, by the block's row.
    pub fn for_each_element(&self, component: &Component, mut add: impl FnMut(usize, usize, f64)) {
        let mut part = |rows: &[usize], columns: &[usize], matrix: &DMatrix<f64>| {
            for (j, column) in columns.iter().enumerate() {
                for (i, row) in rows.iter().enumerate() {
                    add(*row, *column, matrix[(i, j)]);
                }
            }
        };
        for (own, rows) in self.blocks.iter().zip(&component.blocks) {
            part(rows, rows, &own.matrix);
            part(rows, &component.border, &own.with_border);
        }
        part(&component.border, &component.border, &self.border);
    }

    /// The cost of each block.
    pub fn block_costs(&self) -> impl Iterator<Item = f64> {
        self.blocks.iter().map(|block| block.cost)
    }

    /// The Levenberg-Marquardt step; `None` if the damped matrix is singular.
    ///
    /// `dampings` has the damping factor of each block, then that of the border. Coordinates that are `held` do not move; `held` and
    /// the step are in the order of the component.
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
                    // The floor keeps coordinates without influence on the cost in place.
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
        let mut eliminated = Vec::with_capacity(self.blocks.len());
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
            let factor = cholesky(block)?;
            let (per_border, step) = (factor.solve(&with_border), factor.solve(&gradient));
            border -= with_border.tr_mul(&per_border);
            right -= with_border.tr_mul(&step);
            eliminated.push((per_border, step));
        }
        let border_step = if right.is_empty() { right } else { cholesky(border)?.solve(&right) };
        let blocks = eliminated
            .iter()
            .flat_map(|(per_border, step)| (step - per_border * &border_step).data.as_vec().clone());
        let step: Vec<f64> = blocks.chain(border_step.iter().copied()).collect();
        step.iter().all(|x| x.is_finite()).then(|| DVector::from_vec(step))
    }

    /// Decrease of the cost that the quadratic model predicts for `step`.
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
        for BlockEquations { matrix, with_border, .. } in &self.blocks {
            let own = step.rows(start, matrix.nrows());
            start += matrix.nrows();
            curvature += own.dot(&(matrix * own)) + 2.0 * own.dot(&(with_border * border_step));
        }
        -gradient.dot(step) - 0.5 * curvature
    }

    /// For each block, the decrease of the cost of its trials that the quadratic model predicts for `step`.
    pub fn predicted_by_block(&self, step: &DVector<f64>) -> Vec<f64> {
        let border_start = step.len() - self.border.nrows();
        let border_step = step.rows(border_start, self.border.nrows());
        let mut start = 0;
        let predicted = |block: &BlockEquations| {
            let own = step.rows(start, block.matrix.nrows());
            start += block.matrix.nrows();
            let slope = block.gradient.dot(&own) + block.border_gradient_share.dot(&border_step);
            let curvature = own.dot(&(&block.matrix * own))
                + 2.0 * own.dot(&(&block.with_border * border_step))
                + border_step.dot(&(&block.border_share * border_step));
            -slope - 0.5 * curvature
        };
        self.blocks.iter().map(predicted).collect()
    }

    /// Smallest cost of a block that the quadratic model predicts if the border and the block's coordinates in `held` do not move. The
    /// matrix is slightly damped, as in the first step of a descent.
    pub fn predicted_block_cost(&self, block: usize, held: &[bool]) -> f64 {
        let BlockEquations { cost, matrix, gradient, .. } = &self.blocks[block];
        let free: Vec<usize> = (0..held.len()).filter(|i| !held[*i]).collect();
        let mut own = DMatrix::from_fn(free.len(), free.len(), |i, j| matrix[(free[i], free[j])]);
        for i in 0..free.len() {
            own[(i, i)] = own[(i, i)] * (1.0 + 1e-3) + f64::MIN_POSITIVE;
        }
        let gradient = DVector::from_fn(free.len(), |i, _| gradient[free[i]]);
        cholesky(own).map_or(*cost, |factor| cost - 0.5 * gradient.dot(&factor.solve(&gradient)))
    }

    /// For each block the information about the border from all others, at the coordinates `at`: the Schur complement of the others.
    pub fn border_priors_from_others(&self, component: &Component, at: &[f64]) -> Vec<BorderPrior> {
        let through_block = |own: &BlockEquations| {
            let mut matrix = own.matrix.clone();
            for i in 0..matrix.nrows() {
                matrix[(i, i)] = matrix[(i, i)] * (1.0 + 1e-9) + f64::MIN_POSITIVE;
            }
            let factor = cholesky(matrix)?;
            let information = own.with_border.tr_mul(&factor.solve(&own.with_border));
            Some((information, own.with_border.tr_mul(&factor.solve(&own.gradient))))
        };
        let through: Vec<Option<(DMatrix<f64>, DVector<f64>)>> =
            self.blocks.iter().map(|own| through_block(own).filter(|_| own.matrix.nrows() > 0)).collect();
        let at = DVector::from_iterator(component.border.len(), component.border.iter().map(|i| at[*i]));
        let without = |block: usize| {
            let mut information = &self.border - &self.blocks[block].border_share;
            let mut gradient = &self.border_gradient - &self.blocks[block].border_gradient_share;
            let others = through.iter().enumerate().filter(|(index, _)| *index != block);
            for (of_information, of_gradient) in others.filter_map(|(_, other)| other.as_ref()) {
                information -= of_information;
                gradient -= of_gradient;
            }
            BorderPrior { at: at.clone(), gradient, information }
        };
        (0..self.blocks.len()).map(without).collect()
    }

    /// Cost, gradient and Gauss-Newton matrix of a block over its own coordinates alone: for each value of these, the border is at its
    /// best, given the information `others` about it from the other blocks. At an optimum of the border only.
    pub fn block_alone(&self, block: usize, others: &BorderPrior) -> (f64, DVector<f64>, DMatrix<f64>) {
        let BlockEquations { cost, matrix, with_border, gradient, border_share, .. } = &self.blocks[block];
        let through_border = cholesky(border_share + &others.information)
            .map(|factor| with_border * factor.solve(&with_border.transpose()));
        let matrix = through_border.map_or_else(|| matrix.clone(), |known| matrix - known);
        (*cost, gradient.clone(), matrix)
    }

    /// Standard deviations of the coordinates of a block, from its own trials and the information `prior` about the border; infinite
    /// if the data do not determine them.
    pub fn block_standard_deviations(&self, block: usize, prior: &BorderPrior) -> Vec<f64> {
        let BlockEquations { matrix, with_border, border_share, .. } = &self.blocks[block];
        let (own, border) = (matrix.nrows(), border_share.nrows());
        let mut whole = DMatrix::zeros(own + border, own + border);
        whole.view_mut((0, 0), (own, own)).copy_from(matrix);
        whole.view_mut((0, own), (own, border)).copy_from(with_border);
        whole.view_mut((own, 0), (border, own)).copy_from(&with_border.transpose());
        whole.view_mut((own, own), (border, border)).copy_from(&(border_share + &prior.information));
        match invert_scaled(whole) {
            Some(inverse) => (0..own).map(|i| libm::sqrt(inverse[(i, i)])).collect(),
            None => vec![f64::INFINITY; own],
        }
    }
}
