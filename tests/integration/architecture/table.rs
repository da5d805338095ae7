//! Reads the modules and their allowed imports from tables in Markdown.

/// A row of the table of modules.
#[derive(Debug, PartialEq, Eq)]
pub struct Row {
    /// The module.
    pub module: String,
    /// The modules that it may import.
    pub may_import: Vec<String>,
}

/// The rows of the table whose header begins with `header`: the module in the first column, its imports in the last.
pub fn rows(markdown: &str, header: &str) -> Result<Vec<Row>, String> {
    let mut lines = markdown.lines().map(str::trim).skip_while(|line| !line.starts_with(header));
    lines.next().ok_or_else(|| format!("there is no table with the header {header}"))?;
    let mut rows = Vec::new();
    for line in lines.skip(1).take_while(|line| line.starts_with('|')) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
        let module = cells.first().and_then(|cell| names(cell).into_iter().next());
        let module = module.ok_or_else(|| format!("no module is named in the row {line}"))?;
        rows.push(Row { module, may_import: cells.last().map(|cell| names(cell)).unwrap_or_default() });
    }
    Ok(rows)
}

/// The modules that `lib.rs` documents, in its order: the links in the second column of its table.
pub fn modules_of_front_page(lib: &str) -> Vec<String> {
    let cells = lib.lines().filter_map(|line| line.strip_prefix("//! |")?.split('|').nth(1));
    cells.filter_map(|cell| Some(cell.trim().strip_prefix("[`")?.strip_suffix("`]")?.to_owned())).collect()
}

/// The names between backquotes.
fn names(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}
