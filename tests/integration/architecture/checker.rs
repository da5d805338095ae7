//! The checks themselves, tried on small crates with a known fault.

use std::collections::BTreeMap;

use super::graph::{circles, imports_against};
use super::imports::{FileName, Imports, read};
use super::names::{constants_with_two_values, types_defined_twice};
use super::table::{modules_of_front_page, rows};
use super::{file_graph, module_graph};

fn sources(files: &[(&str, &str)]) -> BTreeMap<FileName, String> {
    files.iter().map(|(file, text)| ((*file).to_owned(), (*text).to_owned())).collect()
}

fn imports(files: &[(&str, &str)]) -> Imports {
    read(&sources(files)).expect("the crate can be parsed")
}

/// What `file` of a crate with the modules `a` (with the files `one` and `two`) and `b` imports.
fn imported_by_one(text: &str) -> Vec<String> {
    let files = [
        ("lib.rs", "pub mod a; pub mod b;"),
        ("a/mod.rs", "mod one; mod two; pub use two::Two; pub use two::{deep::Deep, call};"),
        ("a/one.rs", text),
        ("a/two.rs", "pub struct Two; pub fn call() {} pub mod deep { pub struct Deep; }"),
        ("b.rs", "pub struct Bee; pub const LIMIT: f64 = 1.0; pub fn fly() {}"),
    ];
    imports(&files).files["a/one.rs"].keys().cloned().collect()
}

#[test]
fn an_import_is_found_however_it_is_written() {
    let two = ["a/two.rs"];
    let bee = ["b.rs"];
    for (text, expected) in [
        ("use super::two::Two;", two),
        ("use super::Two;", two),
        ("use crate::a::Two as Other;", two),
        ("use super::{Deep};", two),
        ("use crate::{b::{Bee}};", bee),
        ("use ramphold::b;", bee),
        ("use crate::b::{self};", bee),
        ("use crate::b::*;", bee),
        ("fn f() { use crate::b::Bee; }", bee),
        ("fn f() -> crate::b::Bee { loop {} }", bee),
        ("fn f() { super::call(); }", two),
        ("fn f() -> f64 { crate::b::LIMIT }", bee),
        ("fn f() { println!(\"{}\", 2.0 * crate::b::LIMIT); }", bee),
        ("fn f(x: Option<Vec<super::two::deep::Deep>>) {}", two),
        ("#[derive(crate::b::Bee)] struct S;", bee),
        ("#[serde(with = \"crate::b::fly\")] struct S;", bee),
        ("impl super::Two {}", two),
        ("mod inner { fn f() { super::super::call(); } }", two),
        ("pub use crate::b::Bee;", bee),
        ("macro_rules! m { () => { $crate::b::fly() } }", bee),
    ] {
        assert_eq!(imported_by_one(text), expected, "{text}");
    }
}

#[test]
fn what_is_no_import_is_not_taken_for_one() {
    for text in [
        "",
        "#[cfg(test)] mod tests { use crate::b::Bee; }",
        "#[cfg(test)] use crate::b::Bee;",
        "#[test] fn f() { crate::b::fly(); }",
        "struct S; impl S { #[cfg(test)] fn f() { crate::b::fly(); } }",
        "use std::collections::BTreeMap; fn f(b: u8) -> u8 { b }",
        "pub(in crate::a) struct S;",
        "/// Like [`crate::b::Bee`].\nstruct S;",
        "struct Own; mod inner { use super::Own; }",
    ] {
        assert_eq!(imported_by_one(text), Vec::<String>::new(), "{text}");
    }
}

#[test]
fn a_parent_may_pass_on_what_its_children_define_but_not_use_it_unseen() {
    let crate_with = |parent: &str| {
        let files = [
            ("lib.rs", "pub mod a;"),
            ("a/mod.rs", parent),
            ("a/child.rs", "pub struct Child; use super::Rule;"),
        ];
        circles(&file_graph(&imports(&files)))
    };
    let circle = vec![vec!["a/child.rs".to_owned(), "a/mod.rs".to_owned()]];
    assert_eq!(crate_with("mod child; pub use child::Child; pub struct Rule;"), Vec::<Vec<String>>::new());
    assert_eq!(crate_with("mod child; use child::Child; pub struct Rule;"), circle);
    assert_eq!(crate_with("mod child; pub use child::Child; pub struct Rule(Child);"), circle);
    assert_eq!(crate_with("mod child; pub struct Rule(child::Child);"), circle);
}

#[test]
fn a_circle_through_three_files_is_found() {
    let files = [
        ("lib.rs", "mod a; mod b; mod c; mod d;"),
        ("a.rs", "pub fn f() { crate::b::f(); }"),
        ("b.rs", "pub fn f() { crate::c::f(); }"),
        ("c.rs", "use crate::a; pub fn f() { a::f(); }"),
        ("d.rs", "use crate::a;"),
    ];
    assert_eq!(circles(&file_graph(&imports(&files))), [["a.rs", "b.rs", "c.rs"]]);
    assert_eq!(
        imports_against(&["a", "b", "c", "d"].map(str::to_owned), &module_graph(&imports(&files))),
        ["a -> b", "b -> c"]
    );
}

#[test]
fn paths_of_other_crates_are_kept_apart() {
    let found = imports(&[
        ("lib.rs", "mod a;"),
        ("a.rs", "use std::time::Instant; fn f() { std::fs::read(\"x\"); }"),
    ]);
    let external: Vec<&str> = found.external["a.rs"].iter().map(String::as_str).collect();
    assert_eq!(external, ["std::fs::read", "std::time::Instant"]);
}

#[test]
fn a_file_whose_module_a_macro_declares_is_read_as_well() {
    let files = [
        ("lib.rs", "mod a;"),
        ("a.rs", "list! { one } #[cfg(test)] mod tests; pub struct Shared;"),
        ("a/one.rs", "use super::Shared;"),
        ("a/tests.rs", "use super::one::One;"),
    ];
    let found = imports(&files);
    assert_eq!(Vec::from_iter(found.files["a/one.rs"].keys()), ["a.rs"]);
    assert!(!found.files.contains_key("a/tests.rs"));
    let error = read(&sources(&[("lib.rs", ""), ("b/one.rs", "")])).unwrap_err();
    assert_eq!(error, "b/one.rs: no module declares it");
}

#[test]
fn a_module_without_a_file_is_an_error() {
    let error = read(&sources(&[("lib.rs", "mod gone;")])).unwrap_err();
    assert_eq!(error, "lib.rs: the file of module gone is missing");
}

#[test]
fn verbs_are_the_files_that_implement_the_trait() {
    let found = imports(&[
        ("lib.rs", "mod cli;"),
        ("cli.rs", "pub mod run; pub trait Verb {}"),
        ("cli/run.rs", "struct Run; impl super::Verb for Run {}"),
    ]);
    assert_eq!(Vec::from_iter(found.verbs), ["cli/run.rs"]);
}

#[test]
fn a_name_for_two_things_is_found() {
    let files = sources(&[
        (
            "a.rs",
            "struct Guard; pub const LIMIT: f64 = 1.0; const SAME: u8 = 1; impl Guard { const OWN: u8 = 1; }",
        ),
        (
            "b.rs",
            "enum Guard {} const SAME: u8 = 1; fn f() { const LIMIT: f64 = 2.0; } impl Guard { const OWN: u8 = 2; }",
        ),
        ("c.rs", "#[cfg(test)] mod tests { struct Guard; const SAME: u8 = 3; }"),
    ]);
    let both = vec!["a.rs".to_owned(), "b.rs".to_owned()];
    assert_eq!(types_defined_twice(&files).unwrap(), BTreeMap::from([("Guard".to_owned(), both.clone())]));
    assert_eq!(constants_with_two_values(&files).unwrap(), BTreeMap::from([("LIMIT".to_owned(), both)]));
}

#[test]
fn the_table_is_read_from_the_page() {
    let page = "Text.\n\n| Module | What | May import |\n|---|---|---|\n| `a` | first | |\n| `b` | of `x` | `a`, `c` |\n\nEnd.";
    let read = rows(page, "| Module |").unwrap();
    let read: Vec<(&str, Vec<&str>)> = read
        .iter()
        .map(|row| (row.module.as_str(), row.may_import.iter().map(String::as_str).collect()))
        .collect();
    assert_eq!(read, [("a", vec![]), ("b", vec!["a", "c"])]);
    assert!(rows(page, "| Other |").is_err());
    assert_eq!(
        modules_of_front_page("//! | noun | module |\n//! |---|---|\n//! | fit | [`fit`] | x |"),
        ["fit"]
    );
}
