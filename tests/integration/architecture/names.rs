//! Finds names that stand for two things: a type defined twice, a constant defined with two values.

use std::collections::{BTreeMap, BTreeSet};

use quote::ToTokens;
use syn::Item;
use syn::visit::{self, Visit};

use super::imports::{FileName, attributes, is_test_only};

/// Every definition of a name: the files it is in, and its values.
#[derive(Debug, Default)]
struct Definitions {
    files: Vec<FileName>,
    values: BTreeSet<String>,
}

#[derive(Default)]
struct Collector {
    file: FileName,
    types: BTreeMap<String, Definitions>,
    constants: BTreeMap<String, Definitions>,
}

/// Names of types that more than one file defines, each with these files. Traits and aliases count.
pub fn types_defined_twice(
    sources: &BTreeMap<FileName, String>,
) -> Result<BTreeMap<String, Vec<FileName>>, String> {
    let types = collect(sources)?.types.into_iter();
    Ok(types
        .filter(|(_, found)| found.files.iter().collect::<BTreeSet<_>>().len() > 1)
        .map(|(name, found)| (name, found.files))
        .collect())
}

/// Names of constants that are defined with more than one value, each with the files that define it.
pub fn constants_with_two_values(
    sources: &BTreeMap<FileName, String>,
) -> Result<BTreeMap<String, Vec<FileName>>, String> {
    let constants = collect(sources)?.constants.into_iter();
    Ok(constants
        .filter(|(_, found)| found.values.len() > 1)
        .map(|(name, found)| (name, found.files))
        .collect())
}

fn collect(sources: &BTreeMap<FileName, String>) -> Result<Collector, String> {
    let mut collector = Collector::default();
    // Such a file takes the place of another one when a cargo feature is off, and has the same names.
    let is_substitute = |file: &str| file.rsplit('/').next().is_some_and(|name| name.starts_with("without_"));
    for (file, text) in sources.iter().filter(|(file, _)| !is_substitute(file)) {
        collector.file.clone_from(file);
        collector.visit_file(&syn::parse_file(text).map_err(|error| format!("{file}: {error}"))?);
    }
    Ok(collector)
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_item(&mut self, item: &'ast Item) {
        if is_test_only(attributes(item)) {
            return;
        }
        let defines = match item {
            Item::Struct(item) => Some(&item.ident),
            Item::Enum(item) => Some(&item.ident),
            Item::Union(item) => Some(&item.ident),
            Item::Type(item) => Some(&item.ident),
            Item::Trait(item) => Some(&item.ident),
            _ => None,
        };
        if let Some(name) = defines {
            self.types.entry(name.to_string()).or_default().files.push(self.file.clone());
        }
        let constant = match item {
            Item::Const(item) => Some((&item.ident, &item.expr)),
            Item::Static(item) => Some((&item.ident, &item.expr)),
            _ => None,
        };
        if let Some((name, value)) = constant.filter(|(name, _)| *name != "_") {
            let found = self.constants.entry(name.to_string()).or_default();
            found.files.push(self.file.clone());
            found.values.insert(value.to_token_stream().to_string());
        }
        visit::visit_item(self, item);
    }

    /// Constants and types of an implementation or a trait belong to it, and may be called alike.
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
}
