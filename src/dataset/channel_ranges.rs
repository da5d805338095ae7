//! What `session.json` says of its channels: their ranges, and units that they cannot have.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::error::{DatasetError, FilePlace};

/// The field `channels` of `session.json`. All of it may be left out; what is said besides ranges belongs to whoever wrote it.
#[derive(Debug, Default, Deserialize)]
#[serde(transparent)]
pub(super) struct ParsedChannels(Value);

impl ParsedChannels {
    /// Lowest and highest value of each channel of which they are known; `name` is the file.
    ///
    /// # Errors
    /// If a range is no pair of a lower and a higher number, or a unit is not that in the column's name.
    pub fn ranges(&self, name: &str) -> Result<BTreeMap<String, [f64; 2]>, DatasetError> {
        let mut ranges = BTreeMap::new();
        for (column, about) in self.0.as_object().into_iter().flatten() {
            check_unit(name, column, about.get("unit"))?;
            let Some(given) = about.get("range").filter(|given| !given.is_null()) else { continue };
            let range: Option<[f64; 2]> = serde_json::from_value(given.clone()).ok();
            let Some(range) = range.filter(|[low, high]| low < high) else {
                return Err(DatasetError::Value {
                    at: FilePlace::field(name, &format!("channels.{column}.range")),
                    found: given.to_string(),
                    expected: "[lowest, highest] value that the channel can show, in its unit, or null"
                        .to_owned(),
                });
            };
            ranges.insert(column.clone(), range);
        }
        Ok(ranges)
    }
}

/// Refuses a unit other than that in which the records are, as far as the column's name says it.
fn check_unit(name: &str, column: &str, unit: Option<&Value>) -> Result<(), DatasetError> {
    const CHANNEL_UNITS: [(&str, &str, &[&str]); 3] = [
        ("_nm", "N m", &["nm", "n*m", "n·m", "n.m"]),
        ("_rad", "rad", &["rad", "radian", "radians"]),
        ("_rad_s2", "rad/s2", &["rad/s2", "rad/s^2", "rad/s²", "rads-2", "rads^-2"]),
    ];
    let Some(given) = unit.and_then(Value::as_str) else { return Ok(()) };
    let written = given.to_lowercase().replace(char::is_whitespace, "");
    match CHANNEL_UNITS.iter().find(|(ending, ..)| column.ends_with(ending)) {
        Some((_, unit, spellings)) if !spellings.contains(&written.as_str()) => Err(DatasetError::Value {
            at: FilePlace::field(name, &format!("channels.{column}.unit")),
            found: given.to_owned(),
            expected: format!(
                "{unit}, in which the records give this column: convert them, or correct this field"
            ),
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges(text: &str) -> Result<BTreeMap<String, [f64; 2]>, String> {
        let channels: ParsedChannels = serde_json::from_str(text).unwrap();
        channels.ranges("s/session.json").map_err(|error| error.to_string())
    }

    #[test]
    fn ranges_are_read_where_they_are_known() {
        let known =
            ranges(r#"{"torque_l_nm": {"range": [-20, 20]}, "theta_m_rad": {"range": null}, "own": 3}"#);
        assert_eq!(known.unwrap(), BTreeMap::from([("torque_l_nm".to_owned(), [-20.0, 20.0])]));
        assert!(ranges("null").unwrap().is_empty() && ranges("[1]").unwrap().is_empty());
    }

    #[test]
    fn a_unit_other_than_that_of_the_records_is_refused_with_its_field() {
        for (column, unit) in [("torque_l_nm", "N cm"), ("theta_m_rad", "deg"), ("alpha_l_rad_s2", "g")] {
            let refused = ranges(&format!(r#"{{"{column}": {{"unit": "{unit}"}}}}"#)).unwrap_err();
            assert!(refused.contains(&format!("field channels.{column}.unit: \"{unit}\"")), "{refused}");
        }
        for (column, unit) in
            [("torque_l_nm", "Nm"), ("theta_m_rad", "radian"), ("emg_fcr_mvc", "MVC"), ("own", "V")]
        {
            ranges(&format!(r#"{{"{column}": {{"unit": "{unit}", "delay_s": null}}}}"#)).unwrap();
        }
    }

    #[test]
    fn a_range_that_is_none_is_refused_with_its_field() {
        for range in ["[20, -20]", "20", "[1]", "[\"a\", 2]"] {
            let refused = ranges(&format!(r#"{{"torque_l_nm": {{"range": {range}}}}}"#)).unwrap_err();
            assert!(
                refused.contains("field channels.torque_l_nm.range") && refused.contains("[lowest, highest]"),
                "{refused}"
            );
        }
    }
}
