//! Reads `diagnosis.json`: the verdict, and each cause with all its candidates. Lists the fields that are missing.

use serde_json::Value;

use super::scale::significant;
use crate::wrist::mechanisms::CATALOGUE;

/// A diagnosis, as far as its file says it.
#[derive(Debug, Clone)]
pub struct Diagnosed {
    /// The whole file.
    pub root: Value,
    /// The verdict.
    pub verdict: Option<String>,
    /// Misfit statistic of the model as given.
    pub statistic: Option<f64>,
    /// p-value of that misfit.
    pub p_value: Option<f64>,
    /// p-value of the misfit that remains with the causes in the model.
    pub remaining_p_value: Option<f64>,
    /// The causes, each with its candidates.
    pub causes: Vec<DiagnosedCause>,
    /// Numbers of the trials that were analysed; empty if the file does not say.
    pub trials: Vec<u64>,
    /// Fields that are missing in the file.
    pub absent: Vec<String>,
}

/// A cause: the most probable candidate and those that it cannot be distinguished from.
#[derive(Debug, Clone)]
pub struct DiagnosedCause {
    /// The candidates, the most probable first.
    pub candidates: Vec<Candidate>,
    /// Held-out residual with the cause, as a part of that without: value, low and high.
    pub held_out: [Option<f64>; 3],
    /// Variance accounted for, without and with the cause.
    pub vaf: [Option<f64>; 2],
    /// The law that the session shows at its place, if any.
    pub law: Value,
    /// Whether the fit already has it: a constant of the rig that was measured.
    pub is_corrected: bool,
}

/// A mechanism that may be a cause.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its id.
    pub id: String,
    /// What it is.
    pub title: String,
    /// Its class.
    pub class: String,
    /// Probability that it is the one in this place, as far as it is stated.
    pub probability: Option<f64>,
    /// Its parameters as in the file.
    pub parameters: Vec<(String, Value)>,
    /// What it changes.
    pub shifts: Vec<MeanShift>,
}

/// The mean of a quantity over the trials, without and with a candidate in the model, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanShift {
    /// Name of the quantity.
    pub name: String,
    /// Mean without it.
    pub before: f64,
    /// Mean with it.
    pub after: f64,
}

impl Candidate {
    /// What the candidate changes in a quantity; `None` if the diagnosis does not say.
    pub fn shift(&self, name: &str) -> Option<&MeanShift> {
        self.shifts.iter().find(|own| own.name == name)
    }
}

impl DiagnosedCause {
    /// Whether the trace of single trials names it: these trials do not belong.
    pub fn outliers(&self) -> Option<String> {
        let (_, value) = self.candidates.first()?.parameters.iter().find(|(name, _)| name == "trials")?;
        let numbers = value["value"].as_array()?;
        Some(numbers.iter().map(Value::to_string).collect::<Vec<_>>().join(", "))
    }
}

impl Diagnosed {
    /// Reads the file.
    pub fn of(root: &Value) -> Self {
        let mut file = Reader { root, absent: Vec::new() };
        let verdict = file.text("/verdict");
        let [statistic, p_value, remaining_p_value] =
            ["/misfit/statistic", "/misfit/p_value", "/left_over/p_value"].map(|path| file.number(path));
        let count = match root["causes"].as_array() {
            Some(causes) => causes.len(),
            None => {
                file.absent.push("causes".into());
                0
            }
        };
        let causes = (0..count).map(|index| file.cause(&format!("/causes/{index}"))).collect();
        let trials = root.pointer("/residual_by_trial/trials").and_then(Value::as_array);
        Self {
            verdict,
            statistic,
            p_value,
            remaining_p_value,
            causes,
            trials: trials.into_iter().flatten().filter_map(|own| own["trial"].as_u64()).collect(),
            absent: file.absent,
            root: root.clone(),
        }
    }

    /// Whether the model was found adequate.
    pub fn is_adequate(&self) -> bool {
        self.verdict.as_deref() == Some("adequate")
    }

    /// Smallest and largest mean of a quantity with all causes in the model, over their candidates; `None` if the diagnosis does not say.
    /// Each cause is added to those before it, so that the ranges multiply.
    pub fn range_with_causes(&self, name: &str) -> Option<[f64; 2]> {
        let mut range: Option<[f64; 2]> = None;
        for cause in self.causes.iter().filter(|cause| !cause.is_corrected) {
            let shifts: Vec<&MeanShift> = cause.candidates.iter().filter_map(|own| own.shift(name)).collect();
            let after = shifts.iter().map(|own| own.after).filter(|own| own.is_finite());
            let (Some(low), Some(high)) = (after.clone().reduce(f64::min), after.reduce(f64::max)) else {
                continue;
            };
            let before = shifts[0].before;
            // The fit before this cause is that with the first candidates of those above it.
            range =
                Some(range.map_or([low, high], |[lowest, highest]| {
                    [lowest * low / before, highest * high / before]
                }));
        }
        range.map(|[a, b]| [a.min(b), a.max(b)])
    }
}

/// Reads fields, and lists those that are missing.
struct Reader<'a> {
    root: &'a Value,
    absent: Vec<String>,
}

impl Reader<'_> {
    fn missing(&mut self, path: &str) {
        self.absent.push(path.trim_start_matches('/').replace('/', "."));
    }

    fn number(&mut self, path: &str) -> Option<f64> {
        let found = self.root.pointer(path).and_then(Value::as_f64);
        if found.is_none() {
            self.missing(path);
        }
        found
    }

    fn text(&mut self, path: &str) -> Option<String> {
        let found = self.root.pointer(path).and_then(Value::as_str).map(str::to_owned);
        if found.is_none() {
            self.missing(path);
        }
        found
    }

    fn object(&mut self, path: &str) -> Vec<(String, Value)> {
        match self.root.pointer(path).and_then(Value::as_object) {
            Some(own) => own.iter().map(|(name, value)| (name.clone(), value.clone())).collect(),
            None => {
                self.missing(path);
                Vec::new()
            }
        }
    }

    fn cause(&mut self, at: &str) -> DiagnosedCause {
        let mut candidates = vec![self.candidate(at)];
        let others = match self.root.pointer(&format!("{at}/indistinguishable")).and_then(Value::as_array) {
            Some(others) => others.clone(),
            None => {
                self.missing(&format!("{at}/indistinguishable"));
                Vec::new()
            }
        };
        let told = self.root.pointer(&format!("{at}/alternatives")).and_then(Value::as_array);
        let told = told.map_or(0, Vec::len);
        for other in others {
            let id = other.as_str().map_or_else(|| other.to_string(), str::to_owned);
            let path = |place: &usize| format!("{at}/alternatives/{place}");
            let is_it = |place: &usize| {
                self.root.pointer(&format!("{}/mechanism", path(place))).and_then(Value::as_str) == Some(&id)
            };
            match (0..told).find(is_it) {
                Some(place) => candidates.push(self.candidate(&path(&place))),
                None => {
                    self.missing(&format!("{at}/alternatives of {id}"));
                    candidates.push(Candidate {
                        title: title_of(&id).unwrap_or_default(),
                        id,
                        class: String::new(),
                        probability: None,
                        parameters: Vec::new(),
                        shifts: Vec::new(),
                    });
                }
            }
        }
        if let Some(whole) = candidates[0].probability.filter(|_| candidates.len() > 1) {
            // Those of the others are probabilities in this place; so is what they leave.
            let others: f64 = candidates[1..].iter().filter_map(|own| own.probability).sum();
            candidates[0].probability = Some(whole.min(1.0 - others).max(0.0));
        }
        let is_corrected =
            self.root.pointer(&format!("{at}/corrected")).and_then(Value::as_bool) == Some(true);
        let gain = |file: &mut Self, name: &str| {
            if is_corrected {
                return None;
            }
            let path = format!("{at}/gain/held_out_rmse_ratio/{name}");
            if file.is_across_trials(at) && name != "value" {
                return None;
            }
            file.number(&path)
        };
        let held_out = ["value", "low", "high"].map(|name| gain(self, name));
        let is_within = !self.is_across_trials(at) && !is_corrected;
        let vaf = ["vaf_before", "vaf_after"]
            .map(|name| if is_within { self.number(&format!("{at}/gain/{name}")) } else { None });
        let law = self.root.pointer(&format!("{at}/law")).cloned().unwrap_or_default();
        DiagnosedCause { candidates, held_out, vaf, law, is_corrected }
    }

    /// Whether the gain of a cause is one of the trials' k_srs, which has neither interval nor VAF, or there is none of any kind.
    fn is_across_trials(&self, at: &str) -> bool {
        self.root.pointer(&format!("{at}/gain/of")).is_some()
            || self.root.pointer(&format!("{at}/trials")).is_some()
    }

    fn candidate(&mut self, at: &str) -> Candidate {
        let id = self.text(&format!("{at}/mechanism")).unwrap_or_else(|| "not stated".into());
        let class = self.text(&format!("{at}/class")).unwrap_or_default();
        let probability = self.number(&format!("{at}/probability"));
        let parameters = self.object(&format!("{at}/parameters"));
        let shifts = self.object(&format!("{at}/parameter_shift"));
        let shift = |(name, own): (String, Value)| {
            Some(MeanShift { name, before: own["before"].as_f64()?, after: own["after"].as_f64()? })
        };
        let shifts = with_k_after(shifts.into_iter().filter_map(shift).collect());
        let told = self.root.pointer(&format!("{at}/title")).and_then(Value::as_str).map(str::to_owned);
        let title = title_of(&id).or(told).unwrap_or_default();
        Candidate { title, id, class, probability, parameters, shifts }
    }
}

/// Adds k_after = k_srs - k_dec where both are there.
fn with_k_after(mut shifts: Vec<MeanShift>) -> Vec<MeanShift> {
    let of = |name: &str| shifts.iter().find(|own| own.name == name);
    if let (Some(k_srs), Some(k_dec)) = (of("k_srs_nm_per_rad"), of("k_dec_nm_per_rad")) {
        let name = "k_after_nm_per_rad".to_owned();
        let (before, after) = (k_srs.before - k_dec.before, k_srs.after - k_dec.after);
        shifts.push(MeanShift { name, before, after });
    }
    shifts
}

fn title_of(id: &str) -> Option<String> {
    CATALOGUE.iter().find(|kind| kind.id() == id).map(|kind| kind.title().to_owned())
}

/// Endings of the names of parameters, the unit in which they are shown, and its factor from SI units. Angles are in mrad and times in ms, as
/// on the whole page.
const UNITS: [(&str, &str, f64); 17] = [
    ("_nm_per_rad_per_mvc", "N m/rad per MVC", 1.0),
    ("_nm_s_per_rad", "N m s/rad", 1.0),
    ("_rad_per_nm", "mrad/(N m)", 1e3),
    ("_nm_per_rad", "N m/rad", 1.0),
    ("_nm_per_s", "N m/s", 1.0),
    ("_per_rad2", "1/rad²", 1.0),
    ("_per_rad", "1/rad", 1.0),
    ("_rad_s", "rad/s", 1.0),
    ("_kg_m2", "kg m²", 1.0),
    ("_per_nm", "1/(N m)", 1.0),
    ("_per_s", "1/s", 1.0),
    ("_mvc", "MVC", 1.0),
    ("_hz", "Hz", 1.0),
    ("_nm", "N m", 1.0),
    ("_rad", "mrad", 1e3),
    ("_m", "mm", 1e3),
    ("_s", "ms", 1e3),
];

/// A parameter of a mechanism in words, with its unit and its 95 % interval.
pub fn parameter_in_words(name: &str, value: &Value) -> String {
    let (end, unit, factor) =
        UNITS.into_iter().find(|(end, ..)| name.ends_with(end)).unwrap_or(("", "", 1.0));
    let name = name.strip_suffix(end).unwrap_or(name).replace('_', " ");
    if let Some(list) = value["value"].as_array() {
        return format!("{name} {}", list.iter().map(Value::to_string).collect::<Vec<_>>().join(", "));
    }
    let number = |key: &str| value[key].as_f64().map_or("–".into(), |own| significant(own * factor, 3));
    let space = if unit.is_empty() { "" } else { " " };
    format!("{name} {}{space}{unit} [{}, {}]", number("value"), number("low"), number("high"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn file() -> Value {
        json!({
            "verdict": "ambiguous", "misfit": { "statistic": 9.0, "p_value": 0.001 }, "left_over": { "p_value": 0.4 },
            "causes": [{
                "mechanism": "torque_lag", "class": "sensor", "probability": 0.66,
                "parameters": { "cutoff_hz": { "value": 142.0, "low": 134.0, "high": 151.0 } },
                "indistinguishable": ["servo_following"],
                "alternatives": [{
                    "mechanism": "servo_following", "class": "rig", "probability": 0.34,
                    "parameters": { "time_constant_s": { "value": 0.001, "low": 0.0009, "high": 0.0011 } },
                    "parameter_shift": { "k_srs_nm_per_rad": { "before": 20.0, "after": 12.0 } },
                }],
                "gain": { "held_out_rmse_ratio": { "value": 0.4, "low": 0.3, "high": 0.5 }, "vaf_before": 0.9, "vaf_after": 1.0 },
                "parameter_shift": { "k_srs_nm_per_rad": { "before": 20.0, "after": 10.0 } },
            }],
        })
    }

    #[test]
    fn every_candidate_of_a_set_has_its_value_and_its_shift() {
        let found = Diagnosed::of(&file());
        assert!(found.absent.is_empty(), "{:?}", found.absent);
        let ids: Vec<&str> = found.causes[0].candidates.iter().map(|own| own.id.as_str()).collect();
        assert_eq!(ids, ["torque_lag", "servo_following"]);
        let other = &found.causes[0].candidates[1];
        assert_eq!(other.parameters[0].1["value"], 0.001);
        assert_eq!(found.range_with_causes("k_srs_nm_per_rad"), Some([10.0, 12.0]));
        assert_eq!(found.range_with_causes("x_e_rad"), None);
    }

    #[test]
    fn an_older_file_without_the_values_of_a_set_says_what_it_lacks() {
        let mut older = file();
        older["causes"][0].as_object_mut().unwrap().remove("alternatives");
        let found = Diagnosed::of(&older);
        assert_eq!(found.absent, ["causes.0.alternatives of servo_following"]);
        assert_eq!(found.causes[0].candidates.len(), 2);
    }

    #[test]
    fn parameters_are_shown_in_the_units_of_the_page() {
        let value = json!({ "value": 0.025, "low": 0.02, "high": 0.03 });
        assert_eq!(parameter_in_words("latency_s", &value), "latency 25.0 ms [20.0, 30.0]");
        assert_eq!(parameter_in_words("x_0_rad", &value), "x 0 25.0 mrad [20.0, 30.0]");
        assert_eq!(parameter_in_words("gain_nm_s_per_rad", &value), "gain 0.0250 N m s/rad [0.0200, 0.0300]");
        assert_eq!(parameter_in_words("fraction", &value), "fraction 0.0250 [0.0200, 0.0300]");
    }
}
