//! Single trials that do not belong: they are named and left out, nothing is added to the model.

use super::{MechanismClass, Mechanism, MechanismParameter};

/// See the module.
pub struct OutlierTrial;

impl Mechanism for OutlierTrial {
    const ID: &'static str = "outlier_trial";
    const TITLE: &'static str = "single trials do not belong";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const PARAMETERS: &'static [MechanismParameter] = &[
    ];
    const SOURCE: &'static str = "Trials that differ from their repetitions by more than the spread among all";
}
