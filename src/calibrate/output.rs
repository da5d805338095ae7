//! A calibration and a comparison as JSON, for other programs.

use serde_json::{Value, json};

use super::calibration::CalibrationOutcome;
use super::comparison::{QuantityDifference, RigComparison, RigVerdict};
use super::rig_contradiction::named_load;

impl CalibrationOutcome {
    /// The calibration as its file has it, with the residuals and what the loads say of each other.
    pub fn to_json(&self) -> Value {
        let residuals = self.misfit.loads.iter().map(|own| {
            json!({
                "load": own.load.name(), "sign": own.load.sign(), "trials": own.trials, "ratio": own.ratio,
                "p_value": own.p_value,
            })
        });
        let loads = self.loads.iter().map(|own| {
            json!({
                "load": named_load(own.load), "difference": own.difference, "se": own.se,
                "p_value": own.difference.map(|_| own.p_value),
                "probability_wrong": own.by_rig.map(|rig| rig.probability),
                "or": own.or.iter().map(|load| named_load(*load)).collect::<Vec<_>>(),
            })
        });
        json!({
            "calibration": self.calibration,
            "residuals_by_load": residuals.collect::<Vec<_>>(),
            "stated_loads": loads.collect::<Vec<_>>(),
            "p_value_of_servo": self.misfit.servo_p_value,
            "misfit_warning": self.calibration.misfit_warning(),
        })
    }
}

impl RigComparison {
    /// What differs, and how each quantity would if it alone did.
    pub fn to_json(&self) -> Value {
        let one = |own: &QuantityDifference| {
            json!({
                "name": own.name, "calibrated": own.calibrated, "difference": own.difference, "se": own.se,
                "p_value": own.p_value,
            })
        };
        let verdict = self.verdict();
        let reason = match verdict {
            RigVerdict::NotComparable(reason) => Some(reason),
            _ => None,
        };
        json!({
            "trials": self.trials,
            "p_value": self.p_value,
            "verdict": verdict.name(),
            "reason": reason,
            "changed": self.changed,
            "quantities": self.quantities.iter().map(one).collect::<Vec<_>>(),
        })
    }
}
