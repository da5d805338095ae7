//! An elastic limit that is reached after a time rather than at an angle: x_e = x_0 + v x_t.

use super::covariates::{Covariates, DataRequirement};
use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};
use super::prior::Prior;
use crate::number::Number;
use crate::wrist::plant::Plant;

/// Yield after a fixed time instead of at a fixed angle.
pub struct TimedYield;

impl Mechanism for TimedYield {
    const ID: &'static str = "timed_yield";
    const TITLE: &'static str = "the limit is a time, not an angle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const EVIDENCE: EvidenceSource = EvidenceSource::LimitLaw;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new(
            "x_t_s",
            "time at which the muscle yields",
            (0.0, 0.1),
            None,
            0.02,
            Prior::Normal { mean: 0.03, sd: 0.01 },
        ),
        MechanismParameter::new(
            "x_0_rad",
            "angle added to velocity times time",
            (-0.1, 0.1),
            None,
            0.0,
            Prior::Normal { mean: 0.0, sd: 0.02 },
        ),
    ];
    const EQUATION: &'static str = "x_e = x_0 + v x_t";
    const SOURCE: &'static str = "Section 4.1 of de Vlugt et al. 2011: x_e = v x_t (+ x_0)";
    const PRIOR_SOURCE: &'static str = "\
        SRS period of 29.5 ms (section 3.2 of de Vlugt et al. 2011), of which the model may need a part \
        only; x_0: assumed";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Trials, argument: None, sd: 0.0 };
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::Velocities];

    #[inline(always)]
    fn alter_plant<T: Number>(p: &[T], plant: &mut Plant<T>, trial: &Covariates<T::Plain>) {
        plant.elastic_limit = p[1] + p[0].times(trial.velocity_rad_s);
    }
}
