//! Where the session as a whole may be besides the reported place.

use nalgebra::DVector;

use super::convergence::Converged;
use super::other_optimum::OtherOptimum;
use super::trial_blocks::TrialBlocks;
use crate::fit::bordered::BorderedInverse;
use crate::fit::fitted::fit::Fit;
use crate::fit::linalg::cholesky;

/// Another place is reported if it has at least this part of the evidence of the best.
const LEAST_EVIDENCE: f64 = 0.05;

/// Two places are the same if no trial differs by more than this many standard deviations, since the intervals then hold both, or by
/// more than this part of a parameter.
const SAME_PLACE_SDS: f64 = 2.0;
const SAME_PLACE_PART: f64 = 0.1;

/// Another place of the whole session.
#[derive(Debug, Clone)]
pub struct SessionPlace {
    /// Its probability by evidence.
    pub probability: f64,
    /// The coordinates of the fit there.
    pub coordinates: Vec<f64>,
}

impl TrialBlocks {
    /// The places among `ends`, where other searches ended, that the evidence does not rule out beside `best`, whose coordinates have
    /// this `covariance`.
    pub(super) fn other_places(
        &self,
        best: &Converged,
        ends: Vec<Converged>,
        covariance: &BorderedInverse,
    ) -> Vec<SessionPlace> {
        let mut places: Vec<SessionPlace> = Vec::new();
        for end in ends {
            let evidence = libm::exp(best.cost - end.cost);
            let coordinates = &end.fit.solution.coordinates;
            let is_new = |known: &[f64]| !self.is_same_place(known, coordinates, covariance);
            if evidence > LEAST_EVIDENCE
                && is_new(&best.fit.solution.coordinates)
                && places.iter().all(|place| is_new(&place.coordinates))
            {
                places.push(SessionPlace { probability: evidence, coordinates: coordinates.clone() });
            }
        }
        let sum = 1.0 + places.iter().map(|place| place.probability).sum::<f64>();
        places.iter_mut().for_each(|place| place.probability /= sum);
        places
    }

    fn is_same_place(&self, one: &[f64], other: &[f64], covariance: &BorderedInverse) -> bool {
        self.own.iter().all(|own| {
            let by = DVector::from_iterator(own.len(), own.iter().map(|index| one[*index] - other[*index]));
            if by.amax() < SAME_PLACE_PART {
                return true;
            }
            let distance = cholesky(covariance.of(own)).map(|factor| by.dot(&factor.solve(&by)));
            distance.is_some_and(|squared| squared < SAME_PLACE_SDS * SAME_PLACE_SDS)
        })
    }

    /// Adds the values of each trial at the other places to its other optima.
    pub(super) fn add_places(
        &self,
        fit: &Fit,
        places: &[SessionPlace],
        other_optima: &mut [Vec<OtherOptimum>],
    ) {
        let here = 1.0 - places.iter().map(|place| place.probability).sum::<f64>();
        for (trial, others) in other_optima.iter_mut().enumerate() {
            others.iter_mut().for_each(|other| other.probability *= here);
            others.extend(places.iter().map(|place| OtherOptimum {
                values: fit.base_values(trial, &place.coordinates),
                probability: place.probability,
            }));
            others.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        }
    }
}
