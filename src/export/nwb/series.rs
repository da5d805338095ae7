//! A time series of an NWB file.

use hdf5_pure::{AttrValue, GroupBuilder};

use super::objects::{NwbType, ObjectIds, text};

/// Samples with their times.
pub struct Series<'a> {
    /// Name of the series in the group.
    pub name: String,
    /// What it is.
    pub description: String,
    /// What else is known of it.
    pub comments: Option<String>,
    /// Unit of the values.
    pub unit: &'a str,
    /// The values.
    pub values: Vec<f64>,
    /// Time of each value, s.
    pub times_s: Vec<f64>,
}

/// Adds a series to the group `acquisition`; none without values.
pub fn add_series(acquisition: &mut GroupBuilder, own: Series, ids: &ObjectIds) {
    if own.values.is_empty() {
        return;
    }
    let path = format!("/acquisition/{}", own.name);
    let mut series = ids.group(acquisition, NwbType::TimeSeries, &path);
    series.set_attr("description", text(own.description));
    if let Some(comments) = own.comments {
        series.set_attr("comments", text(comments));
    }
    series
        .create_dataset("data")
        .with_f64_data(&own.values)
        .set_attr("conversion", AttrValue::F32(1.0))
        .set_attr("offset", AttrValue::F32(0.0))
        // The value for one that is not known.
        .set_attr("resolution", AttrValue::F32(-1.0))
        .set_attr("unit", text(own.unit));
    series
        .create_dataset("timestamps")
        .with_f64_data(&own.times_s)
        .set_attr("interval", AttrValue::I32(1))
        .set_attr("unit", text("seconds"));
    acquisition.add_group(series.finish());
}
