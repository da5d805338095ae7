//! What `session.json` says of the ranges of its channels.

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
    /// If a range is no pair of a lower and a higher number.
    pub fn ranges(&self, name: &str) -> Result<BTreeMap<String, [f64; 2]>, DatasetError> {
        let mut ranges = BTreeMap::new();
        for (column, about) in self.0.as_object().into_iter().flatten() {
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
