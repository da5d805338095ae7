//! Whether a session has the data that a mechanism needs.

use crate::fit::Observations;
use crate::wrist::mechanisms::{Covariates, MechanismKind};

/// What the session lacks for a mechanism to be considered.
pub fn missing(prepared: &Observations, kind: MechanismKind) -> Option<String> {
    let covariates: Vec<Covariates> = prepared.trials.iter().map(|trial| trial.input.covariates).collect();
    kind.needs().iter().find_map(|need| need.unmet(prepared.lever, &covariates)).map(Into::into)
}
