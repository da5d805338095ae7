//! Tests of what a fit leaves.

use super::null_distribution::{MisfitPValues, MisfitStatistics, NullDistribution, misfit_statistics};
use super::residual_projection::{ResidualProjection, WhitenedTrials};
use super::score_test::{UndetectableMechanism, probes};
use crate::diagnose::evidence::session_prior::SessionPrior;
use crate::fit::{Fit, Observations};
use crate::wrist::mechanisms::MechanismKind;

/// How the residuals of a fit compare with noise alone, and what it could not show.
pub struct TestedFit {
    /// Misfit statistics of the residuals.
    pub misfit: MisfitStatistics,
    /// Their p-values.
    pub p_values: MisfitPValues,
    /// Mechanisms that this session cannot show.
    pub undetectable: Vec<UndetectableMechanism>,
}

impl TestedFit {
    /// Tests the residuals of `fit`, where trials share the drifts of measured constants and the errors of the angle of `prior`. What lies in
    /// the `further` directions is explained as well, and so are the drifts of constants that the causes `changed` are about.
    pub fn new(
        observations: &Observations,
        fit: &Fit,
        further: Vec<WhitenedTrials>,
        changed: &[MechanismKind],
        prior: &SessionPrior,
        seed: u64,
    ) -> Self {
        let drifts = prior.constant_drifts.about(observations, fit);
        let shared = (&drifts, &prior.angle_errors.about(observations, fit));
        let further: Vec<WhitenedTrials> = further.into_iter().chain(drifts.of_constants(changed)).collect();
        let tangent = ResidualProjection::new(observations, fit, &further, shared);
        let (probes, undetectable) = probes(observations, fit, &tangent);
        let misfit = misfit_statistics(observations, &tangent, &probes, &tangent.residuals());
        let noise_alone = NullDistribution::new(observations, &tangent, shared, &probes, seed);
        let p_values = noise_alone.p_values(&misfit);
        tracing::debug!(?misfit, ?p_values, causes = ?fit.kinds);
        Self { misfit, p_values, undetectable }
    }

    /// Whether the residuals could be compared with noise at all.
    pub fn is_finite(&self) -> bool {
        self.misfit.is_finite() && self.p_values.is_finite()
    }
}
