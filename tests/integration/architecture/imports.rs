//! Reads which file of the crate imports from which other file.
//!
//! An import is a `use`, or a path in a type, an expression, a pattern, an attribute of serde or the arguments of a
//! macro. Every path is followed through re-exports to the file that defines the item. Three things are not imports:
//! a `mod` declaration, a `pub use` of an item from the module's own subfolder, and code under `#[cfg(test)]`.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree, Visibility};

/// A file's path below `src`, such as `fit/linalg.rs`.
pub type FileName = String;

/// The imports of a crate.
#[derive(Debug, Default)]
pub struct Imports {
    /// For every file the files that it imports from, each with one of the paths that do so.
    pub files: BTreeMap<FileName, BTreeMap<FileName, String>>,
    /// For every file the paths of items that the crate does not define, such as `std::time::Instant`.
    pub external: BTreeMap<FileName, BTreeSet<String>>,
    /// The files that implement the trait `Verb`.
    pub verbs: BTreeSet<FileName>,
    /// The modules that are declared in `lib.rs`, in alphabetical order.
    pub top_level: BTreeSet<String>,
}

impl Imports {
    /// The imports between top-level modules: importer, imported, and one path that does so.
    pub fn between_modules(&self) -> BTreeMap<(String, String), String> {
        let mut arrows = BTreeMap::new();
        for (from, targets) in &self.files {
            for (to, path) in targets {
                let (importer, imported) = (top_level_module(from), top_level_module(to));
                if importer != imported && importer != "lib" && importer != "main" {
                    arrows.entry((importer, imported)).or_insert_with(|| format!("{from}: {path}"));
                }
            }
        }
        arrows
    }
}

/// The top-level module that a file belongs to: `fit` for `fit/linalg.rs`, `random` for `random.rs`.
pub fn top_level_module(file: &str) -> String {
    file.split('/').next().unwrap_or(file).trim_end_matches(".rs").to_owned()
}

/// Reads the imports of the crate whose files have these texts.
pub fn read(sources: &BTreeMap<FileName, String>) -> Result<Imports, String> {
    let mut tree = Tree::default();
    tree.modules.push(Module { file: "lib.rs".into(), ..Module::default() });
    for root in ["lib.rs", "main.rs"] {
        if sources.contains_key(root) {
            tree.load(0, root, "", sources)?;
        }
    }
    tree.load_undeclared(sources)?;
    let mut imports =
        Imports { top_level: tree.modules[0].children.keys().cloned().collect(), ..Imports::default() };
    for (file, module, parsed) in &tree.parsed {
        let mut collector = Collector { tree: &tree, file, scope: vec![*module], imports: &mut imports };
        collector.imports.files.entry(file.clone()).or_default();
        collector.visit_file(parsed);
    }
    Ok(imports)
}

/// A module of the crate: a file, or an inline module of a file.
#[derive(Debug, Default)]
struct Module {
    file: FileName,
    parent: usize,
    /// Modules declared in it, and where they are in the tree.
    children: BTreeMap<String, usize>,
    /// Names of the items defined in it.
    items: HashSet<String>,
    /// Names that a `use` brings in, with the imported path.
    bindings: HashMap<String, Vec<String>>,
    /// Paths of modules from which a `use` brings in everything.
    globs: Vec<Vec<String>>,
}

/// All modules of the crate; the first is its root.
#[derive(Default)]
struct Tree {
    modules: Vec<Module>,
    parsed: Vec<(FileName, usize, syn::File)>,
    /// Folders and files, without their ending, of modules that are compiled for tests alone.
    test_only: Vec<String>,
}

/// The module that a path names, or that defines the item it names.
#[derive(Clone, Copy)]
enum Target {
    Module(usize),
    ItemOf(usize),
}

impl Target {
    fn module(self) -> usize {
        match self {
            Self::Module(module) | Self::ItemOf(module) => module,
        }
    }
}

impl Tree {
    /// Parses a file into a module, then the files of the modules that it declares, which lie in `folder`.
    fn load(
        &mut self,
        module: usize,
        file: &str,
        folder: &str,
        sources: &BTreeMap<FileName, String>,
    ) -> Result<(), String> {
        let text = sources.get(file).ok_or_else(|| format!("{file}: the file is missing"))?;
        let parsed = syn::parse_file(text).map_err(|error| format!("{file}: {error}"))?;
        self.declare(module, file, folder, &parsed.items, sources)?;
        self.parsed.push((file.to_owned(), module, parsed));
        Ok(())
    }

    /// Loads the files whose module is declared inside a macro. Their path says which module declares them.
    fn load_undeclared(&mut self, sources: &BTreeMap<FileName, String>) -> Result<(), String> {
        for file in sources.keys() {
            let stem = file.trim_end_matches(".rs").trim_end_matches("/mod");
            let is_test_only =
                self.test_only.iter().any(|only| stem == only || stem.starts_with(&format!("{only}/")));
            let is_loaded = self.parsed.iter().any(|(loaded, ..)| loaded == file);
            if is_test_only || is_loaded || file == "lib.rs" || file == "main.rs" {
                continue;
            }
            let mut names: Vec<&str> = stem.split('/').collect();
            let name = names.pop().unwrap_or_default();
            let parent =
                names.iter().try_fold(0, |module, name| self.modules[module].children.get(*name).copied());
            let parent = parent.ok_or_else(|| format!("{file}: no module declares it"))?;
            let child = self.modules.len();
            self.modules.push(Module { file: file.clone(), parent, ..Module::default() });
            self.modules[parent].children.insert(name.to_owned(), child);
            self.load(child, file, stem, sources)?;
        }
        Ok(())
    }

    fn declare(
        &mut self,
        module: usize,
        file: &str,
        folder: &str,
        items: &[Item],
        sources: &BTreeMap<FileName, String>,
    ) -> Result<(), String> {
        let mut uses = Uses::default();
        for item in items {
            uses.visit_item(item);
        }
        for (path, name) in uses.leaves {
            match name {
                Some(name) => drop(self.modules[module].bindings.insert(name, path)),
                None => self.modules[module].globs.push(path),
            }
        }
        for item in items {
            let Item::Mod(declared) = item else {
                if !is_test_only(attributes(item)) {
                    self.modules[module].items.extend(name_of(item));
                }
                continue;
            };
            let name = declared.ident.to_string();
            let below = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
            if is_test_only(&declared.attrs) {
                self.test_only.push(below);
                continue;
            }
            let child = self.modules.len();
            self.modules.push(Module { file: file.to_owned(), parent: module, ..Module::default() });
            self.modules[module].children.insert(name, child);
            if let Some((_, inline)) = &declared.content {
                self.declare(child, file, &below, inline, sources)?;
                continue;
            }
            let own = [format!("{below}.rs"), format!("{below}/mod.rs")];
            let own = own.into_iter().find(|path| sources.contains_key(path));
            let own = own.ok_or_else(|| format!("{file}: the file of module {below} is missing"))?;
            self.modules[child].file.clone_from(&own);
            self.load(child, &own, &below, sources)?;
        }
        Ok(())
    }

    /// Where the item of a path is defined; nothing if the crate does not define it.
    fn resolve(&self, module: usize, path: &[String], seen: &mut HashSet<(usize, String)>) -> Option<Target> {
        let mut module = module;
        let mut rest = path;
        let mut is_anchored = false;
        while let Some(first) = rest.first() {
            match first.as_str() {
                "crate" | "ramphold" => module = 0,
                "self" => {}
                "super" => module = self.modules[module].parent,
                _ => break,
            }
            is_anchored = true;
            rest = &rest[1..];
        }
        self.walk(module, rest, is_anchored, seen)
    }

    fn walk(
        &self,
        module: usize,
        path: &[String],
        is_anchored: bool,
        seen: &mut HashSet<(usize, String)>,
    ) -> Option<Target> {
        let Some((name, rest)) = path.split_first() else { return Some(Target::Module(module)) };
        let here = &self.modules[module];
        if let Some(child) = here.children.get(name)
            && !rest.is_empty()
        {
            return self.walk(*child, rest, true, seen);
        }
        if let Some(imported) = here.bindings.get(name)
            && seen.insert((module, name.clone()))
        {
            return match self.resolve(module, imported, seen)? {
                Target::Module(imported) => self.walk(imported, rest, true, seen),
                item => Some(item),
            };
        }
        if let Some(child) = here.children.get(name) {
            return Some(Target::Module(*child));
        }
        if here.items.contains(name) {
            return Some(Target::ItemOf(module));
        }
        for glob in &here.globs {
            if seen.insert((module, format!("{} of {}", name, glob.join("::"))))
                && let Some(Target::Module(source)) = self.resolve(module, glob, seen)
                && let Some(found) = self.walk(source, path, false, seen)
            {
                return Some(found);
            }
        }
        // The crate has no such name: a macro of the named module may have made it, else it is of another crate.
        is_anchored.then_some(Target::ItemOf(module))
    }

    /// Whether `module` is `ancestor` or lies below it.
    fn lies_in(&self, mut module: usize, ancestor: usize) -> bool {
        while module != ancestor && module != 0 {
            module = self.modules[module].parent;
        }
        module == ancestor
    }
}

/// Collects the leaves of every `use`, also of those in function bodies: path and bound name, or no name for a glob.
#[derive(Default)]
struct Uses {
    leaves: Vec<(Vec<String>, Option<String>)>,
}

impl<'ast> Visit<'ast> for Uses {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_test_only(attributes(item)) && !matches!(item, Item::Mod(_)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if item.leading_colon.is_none() {
            leaves(&item.tree, &mut Vec::new(), &mut self.leaves);
        }
    }
}

fn leaves(tree: &UseTree, prefix: &mut Vec<String>, found: &mut Vec<(Vec<String>, Option<String>)>) {
    let joined = |name: &syn::Ident| {
        let mut path = prefix.clone();
        if name != "self" || path.is_empty() {
            path.push(name.to_string());
        }
        path
    };
    match tree {
        UseTree::Path(path) => {
            prefix.push(path.ident.to_string());
            leaves(&path.tree, prefix, found);
            prefix.pop();
        }
        UseTree::Name(name) => {
            let path = joined(&name.ident);
            let bound = path.last().cloned();
            found.push((path, bound));
        }
        UseTree::Rename(renamed) => found.push((joined(&renamed.ident), Some(renamed.rename.to_string()))),
        UseTree::Glob(_) => found.push((prefix.clone(), None)),
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, prefix, found)),
    }
}

/// Goes through a parsed file and notes every path that leads out of it.
struct Collector<'a> {
    tree: &'a Tree,
    file: &'a str,
    /// The modules around the current place, the innermost last.
    scope: Vec<usize>,
    imports: &'a mut Imports,
}

impl Collector<'_> {
    fn module(&self) -> usize {
        *self.scope.last().expect("the file's own module is always there")
    }

    fn note(&mut self, path: &[String]) {
        match self.tree.resolve(self.module(), path, &mut HashSet::new()) {
            Some(target) => {
                let defined_in = &self.tree.modules[target.module()].file;
                if defined_in != self.file && defined_in != "lib.rs" {
                    let targets = self.imports.files.entry(self.file.to_owned()).or_default();
                    targets.entry(defined_in.clone()).or_insert_with(|| path.join("::"));
                }
            }
            None if path.len() > 1 => {
                let external = self.imports.external.entry(self.file.to_owned()).or_default();
                external.insert(path.join("::"));
            }
            None => {}
        }
    }

    /// Notes the paths in the arguments of a macro, whose grammar is not known.
    fn note_tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(name) => {
                    if colons != 2 {
                        self.note_in_macro(&path);
                        path.clear();
                    }
                    path.push(name.to_string());
                    colons = 0;
                }
                TokenTree::Punct(mark) if mark.as_char() == ':' => colons += 1,
                other => {
                    self.note_in_macro(&path);
                    path.clear();
                    colons = 0;
                    if let TokenTree::Group(group) = other {
                        self.note_tokens(group.stream());
                    }
                }
            }
        }
        self.note_in_macro(&path);
    }

    /// A single name in lower case is more likely a variable than an import.
    fn note_in_macro(&mut self, path: &[String]) {
        if path.len() > 1 || path.first().is_some_and(|name| name.starts_with(char::is_uppercase)) {
            self.note(path);
        }
    }
}

impl<'ast> Visit<'ast> for Collector<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if is_test_only(attributes(item)) {
            return;
        }
        match item {
            Item::Mod(declared) => {
                if let Some((_, items)) = &declared.content {
                    let child = self.tree.modules[self.module()].children[&declared.ident.to_string()];
                    self.scope.push(child);
                    items.iter().for_each(|item| self.visit_item(item));
                    self.scope.pop();
                }
            }
            Item::Impl(implementation) => {
                if let Some((_, of, _)) = &implementation.trait_
                    && of.segments.last().is_some_and(|name| name.ident == "Verb")
                {
                    self.imports.verbs.insert(self.file.to_owned());
                }
                visit::visit_item(self, item);
            }
            _ => visit::visit_item(self, item),
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if item.leading_colon.is_some() {
            return;
        }
        let is_public = !matches!(item.vis, Visibility::Inherited);
        let mut found = Vec::new();
        leaves(&item.tree, &mut Vec::new(), &mut found);
        for (path, _) in found {
            let target = self.tree.resolve(self.module(), &path, &mut HashSet::new());
            let is_own = target.is_some_and(|target| self.tree.lies_in(target.module(), self.module()));
            if !(is_public && is_own) {
                self.note(&path);
            }
        }
    }

    fn visit_impl_item(&mut self, item: &'ast syn::ImplItem) {
        let attributes = match item {
            syn::ImplItem::Fn(item) => &item.attrs,
            syn::ImplItem::Const(item) => &item.attrs,
            syn::ImplItem::Type(item) => &item.attrs,
            _ => return visit::visit_impl_item(self, item),
        };
        if !is_test_only(attributes) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_vis_restricted(&mut self, _: &'ast syn::VisRestricted) {}

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            self.note(&names);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        self.visit_path(&called.path);
        self.note_tokens(called.tokens.clone());
    }

    /// Attributes such as `#[serde(with = "super::units")]` name functions and types in strings.
    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        let is_of_serde = attribute.path().is_ident("serde") || attribute.path().is_ident("schemars");
        if let (true, syn::Meta::List(list)) = (is_of_serde, &attribute.meta) {
            for token in list.tokens.clone() {
                if let TokenTree::Literal(literal) = token
                    && let Ok(text) = syn::parse_str::<syn::LitStr>(&literal.to_string())
                    && let Ok(path) = text.parse::<syn::Path>()
                    && path.segments.len() > 1
                {
                    self.visit_path(&path);
                }
            }
        } else if let syn::Meta::List(list) = &attribute.meta {
            self.note_tokens(list.tokens.clone());
        }
    }
}

/// Whether an item is compiled for tests alone.
pub fn is_test_only(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        syn::Meta::List(list) if list.path.is_ident("cfg") => {
            let condition = list.tokens.to_string().replace(' ', "");
            condition == "test" || condition.starts_with("all(test")
        }
        _ => attribute.path().is_ident("test"),
    })
}

/// The attributes of an item.
pub fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        _ => return None,
    };
    Some(name.to_string())
}
