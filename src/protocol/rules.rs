//! Rules that the schema cannot express: how the fields of a protocol must fit together.
//!
//! The rules read the document rather than the typed protocol, so that a mistake in one place does not hide those in
//! another. They skip values that are missing or already known to be wrong.

mod context;
mod limits;
mod order;
mod rig_trials;

use std::collections::HashSet;

use serde_json::Value;

use super::source::{JsonContent, JsonNode};
use super::units::significant;
use super::{Problem, Protocol};
use crate::signal::{FilterSpec, SLOWEST_CUTOFF_HZ};
use context::Rules;

/// Adds to `problems` every value of `document` that does not fit with the others.
pub(super) fn add_problems(document: &JsonNode, problems: &mut Vec<Problem>) {
    let known = problems.iter().map(|problem| problem.path.clone()).collect();
    let mut rules = Rules { document, known, problems };
    if !rules.lists_have_a_length_that_can_be_checked() {
        return;
    }
    rules.conditions_differ_from_each_other_and_from_zero("velocities_rad_s", 0.01, "rad/s");
    rules.conditions_differ_from_each_other_and_from_zero("torques_nm", 0.01, "N m");
    rules.gate_can_open_in_time();
    rules.antagonist_is_measured_against_its_maximum();
    rules.signal_is_sampled_fast_enough();
    limits::check(&mut rules);
    order::check(&mut rules);
    rig_trials::check(&mut rules);
}

/// As [`add_problems`], the rules on rig trials that simulate their motions; `protocol` is the document as types.
pub(super) fn add_problems_of_rig_trials(
    document: &JsonNode,
    protocol: &Protocol,
    problems: &mut Vec<Problem>,
) {
    rig_trials::check_motions(&mut Rules { document, known: HashSet::new(), problems }, protocol);
}

/// Largest number of velocities and of torques, more than any experiment has. Assumed.
const MAX_LEVELS: usize = 100;

impl Rules<'_> {
    /// The other rules compare each value of a list with each.
    fn lists_have_a_length_that_can_be_checked(&mut self) -> bool {
        let limits = [
            ("velocities_rad_s", MAX_LEVELS),
            ("torques_nm", MAX_LEVELS),
            ("order.trials", order::MAX_PROTOCOL_TRIALS as usize),
        ];
        let long = limits.into_iter().filter(|(list, most)| self.length(list) > *most).collect::<Vec<_>>();
        for (list, most) in &long {
            let found = self.length(list);
            self.add(list, format!("at most {most} values; these are {found}"), "take some away".to_owned());
        }
        long.is_empty()
    }

    fn conditions_differ_from_each_other_and_from_zero(&mut self, list: &str, least: f64, unit: &str) {
        let numbers = self.numbers(list);
        for (index, (path, number)) in numbers.iter().enumerate() {
            if number.abs() < least {
                let expected = format!("at least {least} {unit} in size; the sign is the direction");
                self.add(path, expected, "take it away, or write it in SI units".to_owned());
            }
            if let Some((earlier, _)) = numbers[..index].iter().find(|(_, other)| other == number) {
                let expected = format!("each value once; {earlier} is the same");
                self.add(path, expected, "take it away; \"repetitions\" says how often it is run".to_owned());
            }
        }
    }

    fn gate_can_open_in_time(&mut self) {
        if let (Some(duration_s), Some(timeout_s)) =
            (self.number("gate.duration_s"), self.number("gate.timeout_s"))
            && timeout_s <= duration_s
        {
            let expected = format!("more than gate.duration_s, {duration_s} s; otherwise no gate ever opens");
            self.add(
                "gate.timeout_s",
                expected,
                "give the subject some seconds to find the target".to_owned(),
            );
        }
        if let [(_, low), (path, high)] = &self.numbers("gate.delay_s")[..]
            && high < low
        {
            let expected = format!("the shortest delay first, then the longest: at least {low} s here");
            self.add(path, expected, "exchange the two".to_owned());
        }
    }

    fn antagonist_is_measured_against_its_maximum(&mut self) {
        let has_mvc =
            self.document.at("before.mvc").is_some_and(|mvc| matches!(mvc.content, JsonContent::Object(_)));
        if self.number("gate.antagonist_limit_mvc").is_some() && !has_mvc {
            let expected = "null as long as before.mvc is not measured: EMG has no scale then".to_owned();
            let advice = "add \"mvc\" to \"before\", or write null here".to_owned();
            self.add("gate.antagonist_limit_mvc", expected, advice);
        }
    }

    fn signal_is_sampled_fast_enough(&mut self) {
        if let Some(order) = self.number("signal.filter.order")
            && !(1.0..=f64::from(*FilterSpec::ORDERS.end())).contains(&order)
        {
            let expected = "a whole number from 1 to 8: Order of the filter.".to_owned();
            self.add("signal.filter.order", expected, "the paper's is 3".to_owned());
        }
        if self.number("signal.filter.cutoff_hz").is_some_and(|cutoff_hz| cutoff_hz < SLOWEST_CUTOFF_HZ) {
            let expected = format!(
                "a frequency from {} Hz up, in Hz: a slower filter leaves nothing of the 40 ms that are analysed",
                significant(SLOWEST_CUTOFF_HZ)
            );
            self.add("signal.filter.cutoff_hz", expected, "the paper's is 50".to_owned());
        }
        if self.document.at("signal.filter.zero_phase").is_some_and(|own| own.value() == Value::Bool(true)) {
            let expected = "false: a filter that runs forwards and backwards carries torque from after the window, where reflexes \
                            are, into it"
                .to_owned();
            self.add("signal.filter.zero_phase", expected, "write false here".to_owned());
        }
        let Some(rate_hz) = self.number("signal.sample_rate_hz") else { return };
        if self.number("signal.filter.cutoff_hz").is_some_and(|cutoff_hz| cutoff_hz >= rate_hz / 2.0) {
            let expected = format!("below half the sample rate, {} Hz", rate_hz / 2.0);
            self.add("signal.filter.cutoff_hz", expected, "lower it, or sample faster".to_owned());
        }
        for (path, least) in [("window_s", 10.0), ("ramp.rise_time_s", 5.0)] {
            if self.number(path).is_some_and(|time_s| time_s * rate_hz < least) {
                let least_s = significant(least / rate_hz);
                let expected = format!("at least {least} samples: {least_s} s at {rate_hz} Hz");
                self.add(path, expected, "make it longer, or sample faster".to_owned());
            }
        }
    }
}
