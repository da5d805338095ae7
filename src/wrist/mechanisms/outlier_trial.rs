//! Single trials that do not belong: the diagnosis names them and leaves them out; the model is not changed.

use super::mechanism::{EvidenceSource, Mechanism, MechanismClass};
use super::parameter::MechanismParameter;
use super::place::{LawSpace, Place};

/// Single trials that differ from their repetitions.
pub struct OutlierTrial;

impl Mechanism for OutlierTrial {
    const ID: &'static str = "outlier_trial";
    const TITLE: &'static str = "single trials do not belong";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const EVIDENCE: EvidenceSource = EvidenceSource::SingleTrials;
    const PARAMETERS: &'static [MechanismParameter] = &[];
    const EQUATION: &'static str = "k_srs,trial differs from its repetitions";
    const SOURCE: &'static str =
        "Trials that differ from their repetitions by more than the spread among all";
    const PRIOR_SOURCE: &'static str = "None: it has no parameter";
    const LAW_SPACE: LawSpace = LawSpace { place: Place::Trials, argument: None, sd: 0.0 };
}
