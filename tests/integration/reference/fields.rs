//! Pages of the fields of protocol, subject, rig and study files, from their JSON schemas.

use std::fmt::Write;
use std::fs;

use ramphold::rig::virtual_wrist;
use ramphold::{protocol, study};
use serde_json::{Map, Value};

/// A page: a title, an introduction, and a table of fields for each object of `schema`.
fn page(title: &str, introduction: &str, schema: &str) -> String {
    let schema: Value = serde_json::from_str(schema).unwrap();
    let mut page = format!("# {title}\n\n{introduction}\n");
    object(&mut page, &schema, true);
    for (name, definition) in members(&schema, "$defs") {
        let _ = write!(page, "\n## {name}\n");
        object(&mut page, definition, false);
    }
    page
}

/// The description of a type and its fields; of a choice, each variant's.
fn object(page: &mut String, schema: &Value, introduced: bool) {
    if !introduced {
        paragraph(page, text(schema));
    }
    for field in ["oneOf", "anyOf"] {
        let Some(variants) = schema.get(field).and_then(Value::as_array) else { continue };
        for variant in variants {
            match kind(variant) {
                Some((field, value)) => {
                    let _ = write!(page, "\n### {field}: {value}\n");
                }
                None => {
                    let _ = write!(page, "\n- {}: {}\n", form(variant), text(variant));
                    continue;
                }
            }
            paragraph(page, text(variant));
            // The field that chooses the variant is in the heading.
            if members(variant, "properties").count() > 1 {
                table(page, variant);
            }
        }
    }
    table(page, schema);
    if schema.get("properties").is_none() && schema.get("oneOf").is_none() && schema.get("anyOf").is_none() {
        let _ = write!(page, "\nForm: {}\n", form(schema));
    }
}

fn paragraph(page: &mut String, text: String) {
    if !text.is_empty() {
        let _ = write!(page, "\n{text}\n");
    }
}

/// The field by whose value a variant is chosen, and that value.
fn kind(variant: &Value) -> Option<(&str, &Value)> {
    let (name, value) =
        members(variant, "properties").find_map(|(name, field)| Some((name, field.get("const")?)))?;
    Some((name, value))
}

fn table(page: &mut String, schema: &Value) {
    if schema.get("properties").is_none() {
        return;
    }
    let required: Vec<&str> = schema
        .get("required")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    page.push_str("\n| field | form | default | meaning |\n|---|---|---|---|\n");
    for (name, field) in members(schema, "properties") {
        let default = match field.get("default") {
            // Spaces let the browser break long values.
            Some(value) => format!("`{}`", value.to_string().replace(',', ", ").replace(':', ": ")),
            None if required.contains(&name) => "required".to_owned(),
            None => "none".to_owned(),
        };
        let _ = writeln!(page, "| `{name}` | {} | {default} | {} |", form(field), text(field));
    }
}

/// What a value looks like, with its bounds.
fn form(schema: &Value) -> String {
    if let Some(value) = schema.get("const") {
        return format!("`{value}`");
    }
    if let Some(values) = schema.get("enum").and_then(Value::as_array) {
        return values.iter().map(|value| format!("`{value}`")).collect::<Vec<_>>().join(" or ");
    }
    if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        let name = reference.rsplit('/').next().unwrap();
        return format!("[{name}](#{})", name.to_lowercase());
    }
    for choice in ["anyOf", "oneOf"] {
        if let Some(variants) = schema.get(choice).and_then(Value::as_array) {
            return variants.iter().map(form).collect::<Vec<_>>().join(" or ");
        }
    }
    let kinds = match schema.get("type") {
        Some(Value::String(kind)) => vec![kind.as_str()],
        Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => vec!["any value"],
    };
    let mut form = kinds.iter().map(|kind| described(kind, schema)).collect::<Vec<_>>().join(" or ");
    let bound = |name: &str| schema.get(name).map(ToString::to_string);
    match (bound("minimum"), bound("maximum")) {
        (Some(low), Some(high)) => form.push_str(&format!(", {low} to {high}")),
        (Some(low), None) => form.push_str(&format!(", from {low}")),
        (None, Some(high)) => form.push_str(&format!(", up to {high}")),
        (None, None) => {}
    }
    if let Some(low) = bound("exclusiveMinimum") {
        form.push_str(&format!(", above {low}"));
    }
    form
}

fn described(kind: &str, schema: &Value) -> String {
    match (kind, schema.get("items"), schema.get("prefixItems").and_then(Value::as_array)) {
        ("array", Some(items), _) if items.is_object() => match schema.get("maxItems") {
            Some(count) if schema.get("minItems") == Some(count) => format!("{count} of: {}", form(items)),
            _ => format!("list of: {}", form(items)),
        },
        ("array", _, Some(items)) => format!("[{}]", items.iter().map(form).collect::<Vec<_>>().join(", ")),
        ("object", _, _) if schema.get("additionalProperties").is_some_and(Value::is_object) => {
            format!("object of: {}", form(&schema["additionalProperties"]))
        }
        ("integer", _, _) => "whole number".to_owned(),
        ("string", _, _) => "text".to_owned(),
        ("boolean", _, _) => "`true` or `false`".to_owned(),
        ("null", _, _) => "`null`".to_owned(),
        _ => kind.to_owned(),
    }
}

/// The description of a schema in one line, as it can stand in a table.
fn text(schema: &Value) -> String {
    let text = schema.get("description").and_then(Value::as_str).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

fn members<'a>(schema: &'a Value, field: &str) -> impl Iterator<Item = (&'a str, &'a Value)> {
    let members: Option<&Map<String, Value>> = schema.get(field).and_then(Value::as_object);
    members.into_iter().flatten().map(|(name, value)| (name.as_str(), value))
}

#[test]
fn the_page_of_the_protocols_fields_is_that_of_the_schema() {
    let introduction = "A protocol file says what is run. `ramphold check FILE` reports everything that is wrong with one; \
                        `protocols/de-vlugt-2011.json` is the paper's.\n\n\
                        This page is generated from the JSON schema, which `ramphold schema protocol` prints.";
    expect_test::expect_file!["../../../docs/reference/protocol-fields.md"].assert_eq(&page(
        "Protocol fields",
        introduction,
        &protocol::schema_text(),
    ));
}

#[test]
fn the_page_of_the_subjects_fields_is_that_of_the_schema() {
    let introduction = "A subject file describes a virtual subject for `run --subject FILE` \
                        ([how to write one](../how-to/virtual-wrist.md)). Values marked *assumed* are not in the paper.\n\n\
                        This page is generated from the JSON schema, which `ramphold schema person` prints.";
    expect_test::expect_file!["../../../docs/reference/subject-fields.md"].assert_eq(&page(
        "Subject fields",
        introduction,
        &virtual_wrist::person_schema_text(),
    ));
}

#[test]
fn the_page_of_the_virtual_rigs_fields_is_that_of_the_schema() {
    let introduction = "A rig file of kind `virtual` describes the virtual wrist's motor, lever and sensors, for `run --rig FILE` \
                        ([how to write one](../how-to/virtual-wrist.md)). Values marked *assumed* are not in the paper. A real motor \
                        has [another rig file](motor-rig-fields.md).\n\n\
                        This page is generated from the JSON schema, which `ramphold schema rig` prints.";
    expect_test::expect_file!["../../../docs/reference/virtual-rig-fields.md"].assert_eq(&page(
        "Virtual rig fields",
        introduction,
        &virtual_wrist::rig_schema_text(),
    ));
}

#[test]
fn the_page_of_the_studys_fields_is_that_of_the_schema() {
    let introduction = "A study file says which subjects `cohort` and `power` simulate or read ([how to use it](../how-to/study.md)). Its \
                        fields say *person* for subject.\n\n\
                        This page is generated from the JSON schema, which `ramphold schema study` prints.";
    expect_test::expect_file!["../../../docs/reference/study-fields.md"].assert_eq(&page(
        "Study fields",
        introduction,
        &study::schema_text(),
    ));
}

#[test]
fn the_page_of_the_motor_rigs_fields_names_every_field_of_the_rig_file() {
    let page = include_str!("../../../docs/reference/motor-rig-fields.md");
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/rig/can/file");
    let of_fields = ["rig_file.rs", "motors.rs", "signals.rs"];
    let source = of_fields.map(|file| fs::read_to_string(format!("{folder}/{file}")).unwrap()).concat();
    let mut count = 0;
    let mut renamed = None;
    for line in source.lines().map(str::trim) {
        if let Some(rename) = line.strip_prefix("#[serde(rename = \"") {
            renamed = rename.split('"').next();
        } else if let Some(field) = line.strip_prefix("pub ").and_then(|rest| rest.split_once(": ")) {
            if field.0.contains(' ') {
                continue;
            }
            let name = renamed.take().unwrap_or(field.0);
            assert!(
                page.contains(&format!("`{name}`")),
                "docs/reference/motor-rig-fields.md must describe {name}"
            );
            count += 1;
        } else if let Some(value) = renamed.filter(|_| !line.starts_with(['#', '/'])) {
            // A variant: its name in the file is a value.
            assert!(
                page.contains(&format!("`{value}`")),
                "docs/reference/motor-rig-fields.md must describe {value}"
            );
            renamed = None;
        }
    }
    assert!(count > 80, "{count} fields found");
}

/// A reader copies the rig files of this page: there is a complete one for each kind of motor, each is valid, and none takes
/// on the reader's word what arming proves.
#[test]
fn the_complete_rig_files_of_the_page_on_real_motors_are_valid() {
    let page = include_str!("../../../docs/how-to/real-motor.md");
    let blocks = page.split("```json\n").skip(1).filter_map(|rest| rest.split_once("\n```"));
    let files: Vec<&str> =
        blocks.map(|(text, _)| text).filter(|text| text.contains("\"ramphold-rig/1\"")).collect();
    for file in &files {
        assert!(!file.contains("proved_with_free_handle") && !file.contains("\"bench\""), "{file}");
        ramphold::rig::can::file::ValidRigFile::parse(file, "real-motor.md")
            .unwrap_or_else(|error| panic!("{error}"));
    }
    for kind in ["cia402", "cansimple", "mit"] {
        let motor = format!("\"kind\": \"{kind}\"");
        assert!(
            files.iter().any(|file| file.contains(&motor)),
            "the page shows no rig file of a motor of kind {kind}"
        );
    }
}
