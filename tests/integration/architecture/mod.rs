//! Holds the map in docs/explanation/architecture.md against the imports of the source code.

mod checker;
mod graph;
mod imports;
mod names;
mod table;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use graph::{Graph, circles, imports_against};
use imports::{FileName, Imports};
use table::{Row, modules_of_front_page, rows};

/// The page with the table of allowed imports.
const MAP: &str = "docs/explanation/architecture.md";
/// How the header of that table begins.
const HEADER: &str = "| Module |";

static SOURCES: LazyLock<BTreeMap<FileName, String>> = LazyLock::new(|| {
    let mut sources = BTreeMap::new();
    read_folder(&root().join("src"), "", &mut sources);
    sources
});
static IMPORTS: LazyLock<Imports> =
    LazyLock::new(|| imports::read(&SOURCES).expect("the crate can be parsed"));

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read_folder(folder: &Path, prefix: &str, sources: &mut BTreeMap<FileName, String>) {
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("the folder can be read").path();
        let name = path.file_name().and_then(|name| name.to_str()).expect("names are ASCII").to_owned();
        let name = if prefix.is_empty() { name } else { format!("{prefix}/{name}") };
        if path.is_dir() {
            read_folder(&path, &name, sources);
        } else if name.ends_with(".rs") {
            sources.insert(name, fs::read_to_string(&path).expect("the file can be read"));
        }
    }
}

fn map() -> Vec<Row> {
    let page = fs::read_to_string(root().join(MAP)).expect("the page can be read");
    rows(&page, HEADER).expect("the page has the table")
}

fn file_graph(imports: &Imports) -> Graph {
    imports.files.iter().map(|(file, targets)| (file.clone(), targets.keys().cloned().collect())).collect()
}

/// The source files without those that are compiled for tests alone.
fn program_sources() -> BTreeMap<FileName, String> {
    let is_program = |file: &FileName| IMPORTS.files.contains_key(file);
    SOURCES
        .iter()
        .filter(|(file, _)| is_program(file))
        .map(|(file, text)| (file.clone(), text.clone()))
        .collect()
}

/// The graph of the imports between top-level modules.
fn module_graph(imports: &Imports) -> Graph {
    let mut graph: Graph =
        imports.top_level.iter().map(|module| (module.clone(), Default::default())).collect();
    for (from, to) in imports.between_modules().into_keys() {
        graph.entry(from).or_default().insert(to);
    }
    graph
}

#[test]
fn the_map_names_every_top_level_module_once() {
    let mut named: Vec<String> = map().into_iter().map(|row| row.module).collect();
    named.sort();
    let declared: Vec<String> = IMPORTS.top_level.iter().cloned().collect();
    assert_eq!(named, declared, "{MAP} must have one row for each module of lib.rs");
}

#[test]
fn the_map_allows_exactly_the_imports_that_the_code_has() {
    let allowed: BTreeMap<String, Vec<String>> =
        map().into_iter().map(|row| (row.module, row.may_import)).collect();
    let arrows = IMPORTS.between_modules();
    for ((from, to), place) in &arrows {
        let is_allowed = allowed.get(from).is_some_and(|targets| targets.contains(to));
        assert!(is_allowed, "{place}: {MAP} does not allow {from} to import {to}");
    }
    for (from, targets) in &allowed {
        for to in targets {
            let is_used = arrows.contains_key(&(from.clone(), to.clone()));
            assert!(is_used, "{MAP} allows {from} to import {to}, but no file of {from} does; remove it");
        }
    }
}

#[test]
fn every_module_imports_only_modules_above_it_on_the_map_and_on_the_front_page() {
    let graph = module_graph(&IMPORTS);
    let map: Vec<String> = map().into_iter().map(|row| row.module).collect();
    let front_page = modules_of_front_page(&SOURCES["lib.rs"]);
    assert_eq!(imports_against(&map, &graph), Vec::<String>::new(), "{MAP}: later rows are imported");
    assert_eq!(front_page, map, "the table of modules in src/lib.rs must have the order of {MAP}");
}

#[test]
fn no_file_imports_itself_through_others() {
    let found = circles(&file_graph(&IMPORTS));
    assert!(found.is_empty(), "files import themselves through others: {}", shown(&found));
}

/// The circles, each with the imports that close it.
fn shown(circles: &[Vec<String>]) -> String {
    let mut text = String::new();
    for circle in circles {
        text += &format!("\n{}", circle.join(", "));
        for from in circle {
            for (to, path) in IMPORTS.files[from].iter().filter(|(to, _)| circle.contains(to)) {
                text += &format!("\n    {from} -> {to}: {path}");
            }
        }
    }
    text
}

#[test]
fn a_verb_imports_no_other_verb() {
    assert!(IMPORTS.verbs.len() >= 18, "only {} verbs were found", IMPORTS.verbs.len());
    for verb in &IMPORTS.verbs {
        for (other, path) in &IMPORTS.files[verb] {
            assert!(!IMPORTS.verbs.contains(other), "{verb}: {path} is of the verb {other}");
        }
    }
}

#[test]
fn the_session_knows_nothing_of_the_can_bus() {
    let session = IMPORTS.files.iter().filter(|(file, _)| file.starts_with("session/"));
    for (file, targets) in session {
        for (to, path) in targets {
            assert!(!to.starts_with("rig/can"), "{file}: {path} is of the CAN motor");
        }
    }
}

#[test]
fn the_wrist_knows_no_file_clock_bus_or_statistics() {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("the file can be read");
    let dependencies = dependencies(&manifest);
    assert!(dependencies.contains(&"socketcan".to_owned()), "{dependencies:?}");
    for (file, paths) in IMPORTS.external.iter().filter(|(file, _)| file.starts_with("wrist/")) {
        for path in paths {
            let mut names = path.split("::");
            let is_allowed = match (names.next().unwrap_or_default(), names.next().unwrap_or_default()) {
                ("std", module) => {
                    !["env", "fs", "io", "net", "os", "path", "process", "thread", "time"].contains(&module)
                }
                ("libm" | "serde" | "schemars", _) => true,
                (other, _) => !dependencies.iter().any(|dependency| dependency == other),
            };
            assert!(is_allowed, "{file}: the model must not use {path}");
        }
    }
}

/// The crates that the manifest names, as they are called in paths.
fn dependencies(manifest: &str) -> Vec<String> {
    let mut is_dependency = false;
    let mut names = Vec::new();
    for line in manifest.lines() {
        if let Some(section) = line.strip_prefix('[') {
            is_dependency = section.trim_end_matches(']').ends_with("dependencies");
        } else if let (true, Some((name, _))) = (is_dependency, line.split_once('=')) {
            names.push(name.trim().replace('-', "_"));
        }
    }
    names
}

#[test]
fn no_type_name_stands_for_two_types() {
    let found = names::types_defined_twice(&program_sources()).expect("the crate can be parsed");
    assert!(found.is_empty(), "types of one name: {found:#?}");
}

#[test]
fn no_constant_name_stands_for_two_values() {
    let found = names::constants_with_two_values(&program_sources()).expect("the crate can be parsed");
    assert!(found.is_empty(), "constants of one name and different values: {found:#?}");
}

/// Files beside the module `files` that may open something, what they open, and why.
const OPENERS: [(&str, &str, &str); 3] = [
    ("app/signals.rs", "fs::read_to_string", "/proc, which says whether a signal is ignored"),
    ("cli/run.rs", ".is_file()", "whether the operator typed the name of a file or an identifier"),
    ("console/web/tls.rs", "from_pem_file", "the certificate of the console, which the operator names"),
];

/// What opens, makes, removes or looks at a file.
const OPENING: [&str; 22] = [
    "fs::read",
    "fs::write",
    "fs::copy",
    "fs::rename",
    "fs::remove",
    "fs::create_dir",
    "fs::metadata",
    "fs::canonicalize",
    "fs::symlink_metadata",
    "fs::hard_link",
    "fs::open",
    "fs::mkdir",
    "File::open",
    "File::create",
    "File::options",
    "OpenOptions",
    "from_path(",
    "from_pem_file",
    ".is_dir()",
    ".is_file()",
    ".exists()",
    ".read_dir()",
];

/// The program of a file, without its tests and comments.
fn program_text(text: &str) -> String {
    let program = text.split("#[cfg(test)]").next().unwrap_or_default();
    let program = program.split("#[cfg(all(test").next().unwrap_or_default();
    let lines = program.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// A folder of a stranger is opened by the rules of one module: no links, no devices, limits of size.
#[test]
fn only_the_module_files_opens_files() {
    let mut found = Vec::new();
    for (file, text) in program_sources().iter().filter(|(file, _)| !file.starts_with("files/")) {
        let text = program_text(text);
        for opening in OPENING.iter().filter(|opening| text.contains(**opening)) {
            let is_known = OPENERS
                .iter()
                .any(|(known, what, _)| known == file && what.contains(opening.trim_end_matches('(')));
            if !is_known {
                found.push(format!("{file}: {opening}"));
            }
        }
    }
    assert_eq!(found, Vec::<String>::new(), "use the module files instead");
}
