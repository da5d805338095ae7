//! Covariance of what several trials share, given all trials of a session.

use nalgebra::DMatrix;

use super::hierarchy::Hierarchy;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::uncertainty::coordinate_covariances;
use crate::fit::parameters::coordinate::Transform;

/// Covariance of the coordinates that trials share, such as I_j of a repetition, given all trials.
#[derive(Debug, Clone)]
pub(super) struct SharedCovariance {
    coordinates: Vec<usize>,
    covariance: DMatrix<f64>,
}

impl SharedCovariance {
    /// What is known of the shared coordinates for known means of the conditions, and what an error of these means does to them.
    pub(super) fn new(
        observations: &Observations,
        fit: &Fit,
        hierarchy: &Hierarchy,
        conditions: &[usize],
    ) -> Self {
        let size = hierarchy.trial_variance.len();
        let count = hierarchy.condition_means.len();
        let mut means = DMatrix::zeros(count * size, count * size);
        for one in 0..count {
            for other in 0..count {
                means
                    .view_mut((one * size, other * size), (size, size))
                    .copy_from(&hierarchy.condition_covariance(one, other));
            }
        }
        let components = &fit.parameterisation.components;
        let coordinates: Vec<usize> = components.iter().flat_map(|own| own.border.clone()).collect();
        let mut through_means = DMatrix::zeros(coordinates.len(), count * size);
        let mut covariance = DMatrix::zeros(coordinates.len(), coordinates.len());
        let mut first = 0;
        let alone = coordinate_covariances(observations, fit, &[]).unwrap_or_default();
        for (component, own) in components.iter().zip(&alone) {
            let (border, border_start) = (component.border.len(), own.nrows() - component.border.len());
            covariance
                .view_mut((first, first), (border, border))
                .copy_from(&own.view((border_start, border_start), (border, border)));
            let mut block_start = 0;
            for (block, coordinates) in component.blocks.iter().enumerate() {
                for trial in component.trials_of_block(block) {
                    let precision = DMatrix::from_diagonal(&hierarchy.prior_precision(trial));
                    let of_trial = own.view((border_start, block_start), (border, size)) * precision;
                    let mut part = through_means.view_mut((first, conditions[trial] * size), (border, size));
                    part += of_trial;
                }
                block_start += coordinates.len();
            }
            first += border;
        }
        covariance += &through_means * means * through_means.transpose();
        Self { coordinates, covariance }
    }

    fn place(&self, fit: &Fit, trial: usize, parameter: usize) -> Option<usize> {
        match fit.parameterisation.transforms[trial][parameter] {
            Transform::Logarithmic { coordinate, .. } => {
                self.coordinates.iter().position(|own| *own == coordinate)
            }
            _ => None,
        }
    }

    /// Covariance of the logarithms of a parameter in two trials; `None` where the trials do not share it on a logarithmic scale.
    pub(super) fn of(&self, fit: &Fit, parameter: usize, one: usize, other: usize) -> Option<f64> {
        let place = |trial| self.place(fit, trial, parameter);
        Some(self.covariance[(place(one)?, place(other)?)])
    }
}
