//! Parses JSON and keeps the line of every value, so that messages can name it.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::Value;
use serde_json::value::RawValue;

use super::ProtocolError;

/// A JSON value with its line.
#[derive(Debug, Clone)]
pub(crate) struct JsonNode {
    /// Line of its first character, from 1.
    pub line: usize,
    pub content: JsonContent,
}

#[derive(Debug, Clone)]
pub(crate) enum JsonContent {
    /// Keys in the order of the file; a key that is written twice is there twice.
    Object(Vec<(String, JsonNode)>),
    Array(Vec<JsonNode>),
    /// A number, a string, true, false or null.
    Scalar(Value),
}

impl JsonNode {
    /// Reads a JSON text.
    pub fn parse(text: &str, file: &str) -> Result<Self, ProtocolError> {
        // The first pass also bounds the depth, so that the second may recurse.
        let not_json = |error: serde_json::Error| ProtocolError::NotJson {
            file: file.to_owned(),
            line: error.line(),
            column: error.column(),
            reason: reason(&error),
            advice: advice(text, &error),
        };
        serde_json::from_str::<Value>(text).map_err(not_json)?;
        Self::read(text, text).map_err(not_json)
    }

    fn read(text: &str, part: &str) -> Result<Self, serde_json::Error> {
        let part = part.trim_start();
        // `part` is a slice of `text`.
        let offset = part.as_ptr() as usize - text.as_ptr() as usize;
        let line = 1 + text.as_bytes()[..offset].iter().filter(|byte| **byte == b'\n').count();
        let content = match part.as_bytes().first() {
            Some(b'{') => {
                let Members(members) = serde_json::from_str(part)?;
                let read = |(key, value): (String, &RawValue)| Ok((key, Self::read(text, value.get())?));
                JsonContent::Object(members.into_iter().map(read).collect::<Result<_, serde_json::Error>>()?)
            }
            Some(b'[') => {
                let items: Vec<&RawValue> = serde_json::from_str(part)?;
                JsonContent::Array(
                    items.into_iter().map(|item| Self::read(text, item.get())).collect::<Result<_, _>>()?,
                )
            }
            _ => JsonContent::Scalar(serde_json::from_str(part)?),
        };
        Ok(Self { line, content })
    }

    /// The member called `key`; the last one if there are several.
    pub fn member(&self, key: &str) -> Option<&JsonNode> {
        match &self.content {
            JsonContent::Object(members) => {
                members.iter().rev().find(|(name, _)| name == key).map(|(_, node)| node)
            }
            _ => None,
        }
    }

    /// The item at `index`.
    pub fn item(&self, index: usize) -> Option<&JsonNode> {
        match &self.content {
            JsonContent::Array(items) => items.get(index),
            _ => None,
        }
    }

    /// The value at a path such as `order.trials[2].torque_nm`; itself for the empty path.
    pub fn at(&self, path: &str) -> Option<&JsonNode> {
        path.split(['.', '[']).filter(|step| !step.is_empty()).try_fold(self, |node, step| {
            match step.strip_suffix(']') {
                Some(index) => node.item(index.parse().ok()?),
                None => node.member(step),
            }
        })
    }

    /// As a number.
    pub fn number(&self) -> Option<f64> {
        match &self.content {
            JsonContent::Scalar(value) => value.as_f64(),
            _ => None,
        }
    }

    /// As a plain JSON value.
    pub fn value(&self) -> Value {
        match &self.content {
            JsonContent::Object(members) => {
                members.iter().map(|(key, node)| (key.clone(), node.value())).collect()
            }
            JsonContent::Array(items) => items.iter().map(JsonNode::value).collect(),
            JsonContent::Scalar(value) => value.clone(),
        }
    }
}

/// Text for messages: scalars and short lists as JSON, other values by their type and size.
impl fmt::Display for JsonNode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.content {
            JsonContent::Object(_) => write!(f, "an object"),
            JsonContent::Array(items) if items.is_empty() => write!(f, "an empty list"),
            JsonContent::Array(items) if items.len() <= 4 => write!(f, "{}", self.value()),
            JsonContent::Array(items) => write!(f, "a list of {}", items.len()),
            JsonContent::Scalar(value) => write!(f, "{value}"),
        }
    }
}

struct Members<'a>(Vec<(String, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for Members<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = Vec<(String, &'de RawValue)>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                write!(f, "an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(members)
            }
        }
        deserializer.deserialize_map(InOrder).map(Members)
    }
}

/// The parser's message without the position, which is reported separately.
fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.split(" at line ").next().unwrap_or(&text).to_owned()
}

fn advice(text: &str, error: &serde_json::Error) -> &'static str {
    let reason = error.to_string();
    if text.trim().is_empty() {
        "The file is empty; start from protocols/quick.json"
    } else if text.starts_with('\u{feff}') {
        "The file begins with a byte order mark; save it as UTF-8 without one"
    } else if reason.contains("number out of range") {
        "Write a number that can be measured"
    } else if reason.contains("trailing comma") {
        "Remove the comma before the closing bracket"
    } else if error.is_eof() {
        "The file ends too early; close what is open"
    } else {
        "JSON knows no comments, no NaN, no single quotes and no plus signs; look just before this place"
    }
}
