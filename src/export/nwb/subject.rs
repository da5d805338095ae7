//! The subject of an NWB file.

use hdf5_pure::GroupBuilder;
use serde_json::{Map, Value};

use super::objects::{NwbType, ObjectIds, fill_text, text};
use crate::dataset::SessionCard;

/// The age that NWB writes for one that is not known: any, from birth on.
const ANY_AGE: &str = "P0D/";

/// Adds the subject to the group `general`.
pub fn add_subject(general: &mut GroupBuilder, card: &SessionCard, ids: &ObjectIds) {
    let fields = &card.subject.fields;
    let mut subject = ids.group(general, NwbType::Subject, "/general/subject");
    fill_text(subject.create_dataset("subject_id"), &card.subject.id);
    fill_text(subject.create_dataset("species"), "Homo sapiens");
    fill_text(subject.create_dataset("sex"), sex(fields));
    fill_text(subject.create_dataset("age"), &age(fields)).set_attr("reference", text("birth"));
    if let Some(description) = description(card) {
        fill_text(subject.create_dataset("description"), &description);
    }
    general.add_group(subject.finish());
}

/// Sex as NWB writes it: `M`, `F`, `O` for another one, `U` where it is not known.
fn sex(fields: &Map<String, Value>) -> &'static str {
    match fields.get("sex").and_then(Value::as_str).map(|word| word.trim().to_lowercase()).as_deref() {
        Some("m" | "male") => "M",
        Some("f" | "female") => "F",
        Some("o" | "other") => "O",
        _ => "U",
    }
}

/// Age as a duration of ISO 8601: `P31Y` of a field `age` in years; [`ANY_AGE`] where it is not known.
fn age(fields: &Map<String, Value>) -> String {
    let years = match fields.get("age") {
        Some(Value::Number(years)) => years.as_f64(),
        Some(Value::String(text)) => text.trim().parse().ok(),
        _ => None,
    };
    let is_age = |years: &f64| years.is_finite() && *years >= 0.0;
    years.filter(is_age).map_or(ANY_AGE.to_owned(), |years| format!("P{years}Y"))
}

/// Every field of the subject as it was given, and the hand; `None` without any.
fn description(card: &SessionCard) -> Option<String> {
    let shown = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let mut facts: Vec<String> =
        card.subject.fields.iter().map(|(name, value)| format!("{name}: {}", shown(value))).collect();
    if let Some(hand) = card.about.hand {
        facts.push(format!("hand: {}", shown(&serde_json::json!(hand))));
    }
    (!facts.is_empty()).then(|| facts.join("; "))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn card(subject: Value) -> SessionCard {
        serde_json::from_value(json!({ "subject": subject, "hand": "left" })).unwrap()
    }

    #[test]
    fn what_is_known_of_the_subject_is_written_as_nwb_has_it() {
        let known = |subject: Value| {
            let fields = card(subject).subject.fields;
            (sex(&fields), age(&fields))
        };
        assert_eq!(known(json!({ "id": "S01", "age": 31, "sex": "female" })), ("F", "P31Y".into()));
        assert_eq!(known(json!({ "id": "S01", "age": " 31.5 ", "sex": "M" })), ("M", "P31.5Y".into()));
        for subject in [json!({ "id": "S01" }), json!({ "id": "S01", "age": "young", "sex": "unknown" })] {
            assert_eq!(known(subject), ("U", ANY_AGE.into()));
        }
        let own = card(json!({ "id": "S01", "age": 31, "condition": "fatigued" }));
        assert_eq!(description(&own).as_deref(), Some("age: 31; condition: fatigued; hand: left"));
    }
}
