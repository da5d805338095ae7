//! Whether a session has the data that a mechanism needs.

use crate::fit::Observations;
use crate::wrist::mechanisms::{Covariates, MechanismKind};

/// The data that the session lacks for a mechanism to be tested; `None` if it has them.
pub fn missing(observations: &Observations, kind: MechanismKind) -> Option<String> {
    let covariates: Vec<Covariates> =
        observations.trials.iter().map(|trial| trial.input.covariates).collect();
    kind.needs().iter().find_map(|need| need.unmet(observations.lever, &covariates)).map(Into::into)
}
