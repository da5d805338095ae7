//! Values of trials and conditions as text, with the digits, uncertainty and marks of the report's tables.

use super::fitted::{SHOWN, Shown};
use super::scale::{significant, with_spread};
use crate::fit::{ConditionEstimate, TrialEstimate};

/// Meaning of the mark behind a value.
pub const MARK_MEANING: &str = "* ended at its bound: the data do not determine it, and it is not averaged";

impl Shown {
    /// Place of the quantity among those of an estimate.
    fn index(&self) -> usize {
        SHOWN.iter().position(|other| other.name == self.name).unwrap_or(0)
    }

    /// The digits of a value without a spread.
    fn digits(&self) -> i32 {
        if self.name == "vaf" { 4 } else { 3 }
    }

    /// The value of a trial with its standard error; with a mark if the data do not determine it.
    pub fn text_of_trial(&self, estimate: &TrialEstimate) -> String {
        let index = self.index();
        let Some(value) = estimate.quantities()[index] else { return "–".into() };
        if estimate.determined_quantities()[index].is_none() {
            return format!("{}*", significant(value * self.factor, self.digits()));
        }
        let relative = estimate.se.get(index).copied().flatten();
        self.text(value, relative.map(|relative| relative * value.abs()))
    }

    /// The mean of a condition. Beside it, of trials that were fitted together, its standard error, since their values are drawn
    /// towards each other; of independent ones the standard deviation over repetitions. A mean over fewer trials than the
    /// condition has tells over how many.
    pub fn text_of_condition(&self, condition: &ConditionEstimate, is_together: bool) -> String {
        let index = self.index();
        let Some(mean) = condition.mean[index] else { return "–".into() };
        let relative = condition.se.get(index).copied().flatten();
        let spread =
            if is_together { relative.map(|relative| relative * mean.abs()) } else { condition.sd[index] };
        let text = self.text(mean, spread);
        match condition.averaged[index] {
            all if all == condition.repetitions => text,
            some => format!("{text} (n = {some})"),
        }
    }

    fn text(&self, value: f64, spread: Option<f64>) -> String {
        match spread.map(|spread| with_spread(value * self.factor, spread * self.factor)) {
            Some((value, spread)) => format!("{value} ± {spread}"),
            None => significant(value * self.factor, self.digits()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::by_condition;

    fn estimate(k_srs: f64, x_e_is_determined: bool) -> TrialEstimate {
        let mut determined = [true; 6];
        determined[5] = x_e_is_determined;
        TrialEstimate {
            trial: 1,
            condition: None,
            velocity_rad_s: 1.3,
            torque_nm: 0.9,
            repetition: 1,
            values: [0.005, 1.2, 300.0, k_srs, 12.0, 0.0452],
            k_after_nm_per_rad: k_srs - 12.0,
            x_t_s: Some(0.0295),
            vaf: 0.99412,
            sem: [None; 6],
            se_of_rig: [Some(0.0); 6],
            se: [Some(0.02); 6],
            profile: [None; 2],
            determined,
            other_optima: Vec::new(),
            converged: true,
            remarks: Vec::new(),
        }
    }

    fn shown(sign: &str) -> &'static Shown {
        SHOWN.iter().find(|shown| shown.sign == sign).unwrap()
    }

    #[test]
    fn a_value_at_its_bound_is_marked_and_has_no_part_in_the_mean() {
        let trials = [estimate(20.0, true), estimate(22.0, false)];
        assert_eq!(shown("x_e").text_of_trial(&trials[0]), "45.20 ± 0.90");
        assert_eq!(shown("x_e").text_of_trial(&trials[1]), "45.2*");
        assert_eq!(shown("x_t").text_of_trial(&trials[1]), "29.5*", "it follows from x_e");
        let conditions = by_condition(&trials);
        assert_eq!(shown("x_e").text_of_condition(&conditions[0], true), "45.20 ± 0.90 (n = 1)");
        let none = by_condition(&trials[1..]);
        assert_eq!(shown("x_e").text_of_condition(&none[0], true), "–");
    }

    #[test]
    fn trials_fitted_together_have_the_standard_error_and_others_the_deviation() {
        let conditions = by_condition(&[estimate(20.0, true), estimate(22.0, true)]);
        assert_eq!(shown("k_srs").text_of_condition(&conditions[0], true), "21.00 ± 0.30");
        assert_eq!(shown("k_srs").text_of_condition(&conditions[0], false), "21.0 ± 1.4");
        assert_eq!(shown("VAF").text_of_condition(&conditions[0], true), "0.9941");
    }
}
