//! The shape of an input file: its fields, their types and ranges, walked against the JSON schema of its types.
//!
//! A deserialiser stops at the first mistake; this walk goes on, so that the experimenter sees all of them. It also makes a
//! document in which every mistake is replaced by a stand-in of the right shape, so that rules that need the types can be
//! checked on what is left.

use serde_json::{Map, Value, json};

use super::source::{JsonContent, JsonNode};
use super::{Problem, ProtocolError, units};

/// What a document is walked against.
pub(crate) struct Shape<'a> {
    /// The JSON schema.
    pub schema: &'a Value,
    /// A complete file of this kind, for advice.
    pub example: &'static str,
    /// What is wrong with a text of a `format` of the schema.
    pub format_error: fn(format: &str, text: &str) -> Option<String>,
    /// A text of a `format`, as a stand-in.
    pub format_example: fn(format: &str) -> Option<&'static str>,
}

/// A document after the walk.
pub(crate) struct Walked {
    /// Everything in which the document differs from the schema.
    pub problems: Vec<Problem>,
    /// The document, with a stand-in for each problem.
    pub repaired: Value,
}

impl Shape<'_> {
    /// Compares a document with the schema.
    pub(crate) fn walk(&self, document: &JsonNode) -> Walked {
        let mut walk = Walk { shape: self, problems: Vec::new() };
        let repaired = walk.value(document, self.schema, "");
        Walked { problems: walk.problems, repaired }
    }
}

/// Everything in which the JSON `text` of a file differs from `schema`; `example` names a complete file of its kind.
///
/// # Errors
/// If the text is not JSON.
pub fn check_shape(
    text: &str,
    file: &str,
    schema: &Value,
    example: &'static str,
) -> Result<Vec<Problem>, ProtocolError> {
    let document = JsonNode::parse(text, file)?;
    let shape = Shape { schema, example, format_error: |_, _| None, format_example: |_| None };
    Ok(shape.walk(&document).problems)
}

struct Walk<'a> {
    shape: &'a Shape<'a>,
    problems: Vec<Problem>,
}

impl Walk<'_> {
    /// Returns the value, or a stand-in for what is wrong with it.
    fn value(&mut self, node: &JsonNode, schema: &Value, path: &str) -> Value {
        let schema = &self.resolved(schema);
        if let Some(variants) = schema["oneOf"].as_array() {
            return match choices(variants) {
                Some(choices) => self.choice(node, schema, &choices, path),
                None => self.tagged(node, schema, variants, path),
            };
        }
        if !has_type(node, schema) {
            let example = self.shape.example;
            let advice = match &node.content {
                JsonContent::Scalar(Value::String(_)) if is_numeric(schema) => {
                    "write a number, without quotes"
                }
                JsonContent::Scalar(Value::Number(_)) if is_numeric(schema) => {
                    "write a whole number, without a point"
                }
                _ if is_numeric(schema) => "write a number",
                _ => &format!("see the same field in {example}"),
            };
            self.add(path, node, expectation(schema), advice.to_owned());
            return self.stand_in(schema);
        }
        match &node.content {
            JsonContent::Object(members) => self.object(node, members, schema, path),
            JsonContent::Array(items) => self.array(node, items, schema, path),
            JsonContent::Scalar(value) => self.scalar(node, value, schema, path),
        }
    }

    /// One of a few texts.
    fn choice(&mut self, node: &JsonNode, schema: &Value, choices: &[Value], path: &str) -> Value {
        let value = node.value();
        if choices.contains(&value) {
            return value;
        }
        let name = |choice: &Value| choice.as_str().map_or_else(|| choice.to_string(), str::to_owned);
        let names: Vec<String> = choices.iter().map(name).collect();
        let advice = match value.as_str().and_then(|text| closest(text, &names)) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => "choose one of these".to_owned(),
        };
        self.add(path, node, format!("one of {}: {}", names.join(", "), description(schema)), advice);
        choices[0].clone()
    }

    /// An enum: an object whose `kind` says which fields it has.
    fn tagged(&mut self, node: &JsonNode, schema: &Value, variants: &[Value], path: &str) -> Value {
        let kind_of = |variant: &Value| variant["properties"]["kind"]["const"].as_str().map(str::to_owned);
        let kinds: Vec<String> = variants.iter().filter_map(kind_of).collect();
        let expected = format!("\"kind\" as one of {}: {}", kinds.join(", "), description(schema));
        if !matches!(node.content, JsonContent::Object(_)) {
            let advice = format!("write an object such as {{ \"kind\": \"{}\" }}", kinds.join("\" or \""));
            self.add(path, node, format!("an object with {expected}"), advice);
            return self.stand_in(schema);
        }
        let kind_path = join(path, "kind");
        let Some(kind_node) = node.member("kind") else {
            self.missing(&kind_path, node, expected, "kind");
            return self.stand_in(schema);
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
                self.stand_in(schema)
            }
        }
    }

    fn object(
        &mut self,
        node: &JsonNode,
        members: &[(String, JsonNode)],
        schema: &Value,
        path: &str,
    ) -> Value {
        let Some(properties) = schema["properties"].as_object() else { return node.value() };
        let mut repaired = Map::new();
        let names: Vec<String> = properties.keys().cloned().collect();
        for (index, (name, member)) in members.iter().enumerate() {
            let member_path = join(path, name);
            if members[..index].iter().any(|(earlier, _)| earlier == name) {
                let advice = "take one of the two away".to_owned();
                self.add(&member_path, member, "each field once; this one is written twice".into(), advice);
            }
            match properties.get(name) {
                Some(property) => {
                    let value = self.value(member, property, &member_path);
                    repaired.insert(name.clone(), value);
                }
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
                let expected = expectation(&self.resolved(&properties[name]));
                self.missing(&join(path, name), node, expected, name);
                repaired.insert(name.to_owned(), self.stand_in(&properties[name]));
            }
        }
        Value::Object(repaired)
    }

    fn array(&mut self, node: &JsonNode, items: &[JsonNode], schema: &Value, path: &str) -> Value {
        let (least, most) = (schema["minItems"].as_u64(), schema["maxItems"].as_u64());
        let count = items.len() as u64;
        let mut is_wrong = false;
        if least.is_some_and(|least| count < least) || most.is_some_and(|most| count > most) {
            let advice = match (least, most) {
                (Some(least), Some(most)) if least == most => format!("write exactly {least}"),
                _ => "write at least one".to_owned(),
            };
            self.add(path, node, expectation(schema), advice);
            is_wrong = true;
        }
        let mut item_schema = self.resolved(&schema["items"]);
        if item_schema["description"].is_null() {
            item_schema["description"] = schema["description"].clone();
        }
        let each = items.iter().enumerate();
        let repaired: Value =
            each.map(|(index, item)| self.value(item, &item_schema, &format!("{path}[{index}]"))).collect();
        if is_wrong { self.stand_in(schema) } else { repaired }
    }

    fn scalar(&mut self, node: &JsonNode, value: &Value, schema: &Value, path: &str) -> Value {
        let found = self.problems.len();
        if let Some(only) = schema.get("const").filter(|only| *only != value) {
            let advice = format!("write {only}; this version reads no other");
            self.add(path, node, expectation(schema), advice);
            return only.clone();
        }
        if let Some(choices) = schema["enum"].as_array().filter(|choices| !choices.contains(value)) {
            return self.choice(node, schema, choices, path);
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
        if let (Some(format), Some(text)) = (schema["format"].as_str(), value.as_str())
            && let Some(expected) = (self.shape.format_error)(format, text)
        {
            let advice = format!("see the same field in {}", self.shape.example);
            self.add(path, node, format!("{expected}: {}", description(schema)), advice);
        }
        if self.problems.len() > found { self.stand_in(schema) } else { value.clone() }
    }

    /// A value of the right shape, of no meaning.
    fn stand_in(&self, schema: &Value) -> Value {
        let schema = &self.resolved(schema);
        if let Some(only) = schema.get("const") {
            return only.clone();
        }
        for list in ["oneOf", "enum"] {
            if let Some(first) = schema[list].as_array().and_then(|variants| variants.first()) {
                return if list == "enum" { first.clone() } else { self.stand_in(first) };
            }
        }
        match types(schema).first().copied() {
            Some("object") => {
                let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
                required
                    .map(|name| (name.to_owned(), self.stand_in(&schema["properties"][name])))
                    .collect::<Map<_, _>>()
                    .into()
            }
            Some("array") => {
                let least = schema["minItems"].as_u64().unwrap_or(0) as usize;
                vec![self.stand_in(&schema["items"]); least].into()
            }
            Some("number" | "integer") => {
                let least = schema["minimum"].as_f64().filter(|least| *least > 1.0);
                let most = schema["maximum"].as_f64().filter(|most| *most < 1.0);
                least
                    .or(most)
                    .map_or_else(|| json!(1), |_| schema.get("minimum").cloned().unwrap_or(json!(0)))
            }
            Some("string") => {
                let example = schema["format"].as_str().and_then(self.shape.format_example);
                json!(example.unwrap_or("text"))
            }
            Some("boolean") => json!(false),
            _ => Value::Null,
        }
    }

    /// The schema that counts: references followed, and of "this or null" the first with null among its types.
    fn resolved(&self, schema: &Value) -> Value {
        let options = schema["anyOf"].as_array();
        let chosen = options.and_then(|options| options.iter().find(|option| option["type"] != "null"));
        let mut target = chosen.unwrap_or(schema).clone();
        while let Some(name) = target["$ref"].as_str().and_then(|path| path.strip_prefix("#/$defs/")) {
            target = self.shape.schema["$defs"][name].clone();
        }
        if chosen.is_some() {
            target["type"] = json!([target["type"], "null"]);
        }
        // The field's own words say more than those of its type.
        if let Some(own) = schema.get("description") {
            target["description"] = own.clone();
        }
        target
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

/// The texts of an enum without fields.
fn choices(variants: &[Value]) -> Option<Vec<Value>> {
    let lists = variants.iter().map(|variant| match variant["enum"].as_array() {
        Some(several) => Some(several.clone()),
        None => variant.get("const").map(|only| vec![only.clone()]),
    });
    Some(lists.collect::<Option<Vec<_>>>()?.concat())
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

/// What a value of several shapes can be, as text.
fn variants(schema: &Value) -> String {
    let tag = |variant: &Value| {
        let (name, property) =
            variant["properties"].as_object()?.iter().find(|(_, own)| own["const"].is_string())?;
        Some(format!("{{\"{name}\": {}, ...}}", property["const"]))
    };
    let alternatives = schema["oneOf"].as_array().into_iter().flatten();
    let shown: Vec<String> = match schema["oneOf"].as_array().and_then(|own| choices(own)) {
        Some(choices) => choices.iter().map(Value::to_string).collect(),
        None => alternatives.filter_map(tag).collect(),
    };
    if shown.is_empty() { "another value".to_owned() } else { shown.join(" or ") }
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
    let words: Vec<String> = words.collect();
    let words = if words.is_empty() { variants(schema) } else { words.join(" or ") };
    format!("{words}: {}", description(schema))
}

/// The known name that is most similar to `name`, if one is similar enough.
pub fn closest<'a>(name: &str, names: &'a [String]) -> Option<&'a str> {
    let likeness = |known: &str| strsim::jaro_winkler(&name.to_lowercase(), known);
    let best = names.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(best) > 0.8).then_some(best)
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}
