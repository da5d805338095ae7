//! The shape of a protocol: its fields, their types and ranges, walked against the JSON schema of the types.
//!
//! A deserialiser stops at the first mistake; this walk goes on, so that the experimenter sees all of them.

use serde_json::Value;

use super::schema::SCHEMA;
use super::source::{JsonContent, JsonNode};
use super::{Problem, units};

/// Everything in which the document differs from the schema.
pub(super) fn problems(document: &JsonNode) -> Vec<Problem> {
    let mut walk = Walk { problems: Vec::new() };
    walk.value(document, &SCHEMA, "");
    walk.problems
}

struct Walk {
    problems: Vec<Problem>,
}

impl Walk {
    fn value(&mut self, node: &JsonNode, schema: &Value, path: &str) {
        let schema = &resolved(schema);
        if let Some(variants) = schema["oneOf"].as_array() {
            return self.tagged(node, schema, variants, path);
        }
        if !has_type(node, schema) {
            let advice = match &node.content {
                JsonContent::Scalar(Value::String(_)) if is_numeric(schema) => {
                    "write a number, without quotes"
                }
                JsonContent::Scalar(Value::Number(_)) if is_numeric(schema) => {
                    "write a whole number, without a point"
                }
                _ if is_numeric(schema) => "write a number",
                _ => "see the same field in protocols/quick.json",
            };
            return self.add(path, node, expectation(schema), advice.to_owned());
        }
        match &node.content {
            JsonContent::Object(members) => self.object(node, members, schema, path),
            JsonContent::Array(items) => self.array(node, items, schema, path),
            JsonContent::Scalar(value) => self.scalar(node, value, schema, path),
        }
    }

    /// An enum: an object whose `kind` says which fields it has.
    fn tagged(&mut self, node: &JsonNode, schema: &Value, variants: &[Value], path: &str) {
        let kind_of = |variant: &Value| variant["properties"]["kind"]["const"].as_str().map(str::to_owned);
        let kinds: Vec<String> = variants.iter().filter_map(kind_of).collect();
        let expected = format!("\"kind\" as one of {}: {}", kinds.join(", "), description(schema));
        if !matches!(node.content, JsonContent::Object(_)) {
            let advice = format!("write an object such as {{ \"kind\": \"{}\" }}", kinds.join("\" or \""));
            return self.add(path, node, format!("an object with {expected}"), advice);
        }
        let kind_path = join(path, "kind");
        let Some(kind_node) = node.member("kind") else {
            return self.missing(&kind_path, node, expected, "kind");
        };
        let kind = kind_node.value();
        match variants.iter().find(|variant| variant["properties"]["kind"]["const"] == kind) {
            Some(variant) => self.value(node, variant, path),
            None => {
                let advice = match kind.as_str().and_then(|kind| closest(kind, &kinds)) {
                    Some(meant) => format!("did you mean \"{meant}\"?"),
                    None => "choose one of these".to_owned(),
                };
                self.add(&kind_path, kind_node, expected, advice);
            }
        }
    }

    fn object(&mut self, node: &JsonNode, members: &[(String, JsonNode)], schema: &Value, path: &str) {
        let Some(properties) = schema["properties"].as_object() else { return };
        let names: Vec<String> = properties.keys().cloned().collect();
        for (index, (name, member)) in members.iter().enumerate() {
            let member_path = join(path, name);
            if members[..index].iter().any(|(earlier, _)| earlier == name) {
                let advice = "take one of the two away".to_owned();
                self.add(&member_path, member, "each field once; this one is written twice".into(), advice);
            }
            match properties.get(name) {
                Some(property) => self.value(member, property, &member_path),
                None => {
                    let advice = match closest(name, &names) {
                        Some(meant) => format!("did you mean {meant}? Otherwise take it away"),
                        None => "take it away".to_owned(),
                    };
                    let expected = format!("no field of this name; the fields here are {}", names.join(", "));
                    self.add(&member_path, member, expected, advice);
                }
            }
        }
        for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if node.member(name).is_none() {
                let expected = expectation(&resolved(&properties[name]));
                self.missing(&join(path, name), node, expected, name);
            }
        }
    }

    fn array(&mut self, node: &JsonNode, items: &[JsonNode], schema: &Value, path: &str) {
        let (least, most) = (schema["minItems"].as_u64(), schema["maxItems"].as_u64());
        let count = items.len() as u64;
        if least.is_some_and(|least| count < least) || most.is_some_and(|most| count > most) {
            let advice = match (least, most) {
                (Some(least), Some(most)) if least == most => format!("write exactly {least}"),
                _ => "write at least one".to_owned(),
            };
            self.add(path, node, expectation(schema), advice);
        }
        let mut item_schema = resolved(&schema["items"]);
        if item_schema["description"].is_null() {
            item_schema["description"] = schema["description"].clone();
        }
        for (index, item) in items.iter().enumerate() {
            self.value(item, &item_schema, &format!("{path}[{index}]"));
        }
    }

    fn scalar(&mut self, node: &JsonNode, value: &Value, schema: &Value, path: &str) {
        if let Some(only) = schema.get("const").filter(|only| *only != value) {
            let advice = format!("write {only}; this version reads no other");
            return self.add(path, node, expectation(schema), advice);
        }
        if let Some(number) = value.as_f64() {
            let (low, high) = (schema["minimum"].as_f64(), schema["maximum"].as_f64());
            let in_range = |x: f64| low.is_none_or(|low| x >= low) && high.is_none_or(|high| x <= high);
            if !in_range(number) {
                let advice = units::mistaken_unit(path, number, in_range)
                    .unwrap_or_else(|| "write a number in this range".to_owned());
                self.add(path, node, expectation(schema), advice);
            }
        }
        if value.as_str().is_some_and(|text| text.trim().is_empty()) && schema["minLength"].as_u64() > Some(0)
        {
            self.add(path, node, expectation(schema), "write a text that is not empty".to_owned());
        }
    }

    fn add(&mut self, path: &str, node: &JsonNode, expected: String, advice: String) {
        let value = Some(node.to_string());
        self.problems.push(Problem { path: path.to_owned(), line: node.line, value, expected, advice });
    }

    fn missing(&mut self, path: &str, parent: &JsonNode, expected: String, name: &str) {
        let advice = format!("add \"{name}\"");
        self.problems.push(Problem {
            path: path.to_owned(),
            line: parent.line,
            value: None,
            expected,
            advice,
        });
    }
}

/// The schema that counts: references followed, and of "this or null" the first with null among its types.
fn resolved(schema: &Value) -> Value {
    let options = schema["anyOf"].as_array();
    let chosen = options.and_then(|options| options.iter().find(|option| option["type"] != "null"));
    let mut target = chosen.unwrap_or(schema).clone();
    while let Some(name) = target["$ref"].as_str().and_then(|path| path.strip_prefix("#/$defs/")) {
        target = SCHEMA["$defs"][name].clone();
    }
    if chosen.is_some() {
        target["type"] = serde_json::json!([target["type"], "null"]);
    }
    // The field's own words say more than those of its type.
    if let Some(own) = schema.get("description") {
        target["description"] = own.clone();
    }
    target
}

fn types(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::Array(types) => types.iter().filter_map(Value::as_str).collect(),
        other => other.as_str().into_iter().collect(),
    }
}

fn has_type(node: &JsonNode, schema: &Value) -> bool {
    types(schema).iter().any(|wanted| match (&node.content, *wanted) {
        (JsonContent::Object(_), "object") | (JsonContent::Array(_), "array") => true,
        (JsonContent::Scalar(value), "integer") => value.is_u64() || value.is_i64(),
        (JsonContent::Scalar(value), "number") => value.is_number(),
        (JsonContent::Scalar(value), "string") => value.is_string(),
        (JsonContent::Scalar(value), "boolean") => value.is_boolean(),
        (JsonContent::Scalar(value), "null") => value.is_null(),
        _ => false,
    })
}

fn is_numeric(schema: &Value) -> bool {
    types(schema).iter().any(|wanted| ["number", "integer"].contains(wanted))
}

fn description(schema: &Value) -> &str {
    schema["description"].as_str().unwrap_or("see ramphold schema")
}

/// The expected value of a field, as text: "a number from 0.001 to 1: Amplitude: the angle by which the motor turns, rad."
fn expectation(schema: &Value) -> String {
    if let Some(only) = schema.get("const") {
        return format!("{only}: {}", description(schema));
    }
    let range = match (schema["minimum"].as_f64(), schema["maximum"].as_f64()) {
        (Some(low), Some(high)) => format!(" from {low} to {high}"),
        (Some(low), None) => format!(" of {low} or more"),
        (None, Some(high)) => format!(" of {high} or less"),
        (None, None) => String::new(),
    };
    let words = types(schema).into_iter().map(|wanted| match wanted {
        "object" => "an object".to_owned(),
        "array" => match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
            (Some(least), Some(most)) if least == most => format!("a list of {least} numbers"),
            _ => "a list of at least one".to_owned(),
        },
        "integer" => format!("a whole number{range}"),
        "number" => format!("a number{range}"),
        "string" => "a text".to_owned(),
        "boolean" => "true or false".to_owned(),
        other => other.to_owned(),
    });
    format!("{}: {}", words.collect::<Vec<_>>().join(" or "), description(schema))
}

/// The known name that is most similar to `name`, if one is similar enough.
fn closest<'a>(name: &str, names: &'a [String]) -> Option<&'a str> {
    let likeness = |known: &str| strsim::jaro_winkler(&name.to_lowercase(), known);
    let best = names.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(best) > 0.8).then_some(best)
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}
