//! Sets the environment variable RAMPHOLD_COMMIT to the commit that the program is built from, if it is known; RAMPHOLD_BUILT_FROM to
//! the same or "unknown", and RAMPHOLD_FEATURES to the optional parts that are built in, both for `--version`.
//!
//! Only release builds get it, because other builds are made of work in progress. An archive made by git contains the
//! commit in the file COMMIT (see .gitattributes). Elsewhere git is asked. Without both, the commit is unknown and the
//! build goes on.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=RAMPHOLD_FEATURES={}", features());
    println!("cargo::rustc-env=RAMPHOLD_BUILT_FROM=unknown");
    if std::env::var("PROFILE").as_deref() != Ok("release") {
        return;
    }
    println!("cargo::rerun-if-changed=COMMIT");
    println!("cargo::rerun-if-changed=src");
    for file in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", file]) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let archived = std::fs::read_to_string("COMMIT").unwrap_or_default().trim().to_owned();
    let is_hash = |text: &str| text.len() >= 40 && text.bytes().take(40).all(|byte| byte.is_ascii_hexdigit());
    let commit = if is_hash(&archived) {
        Some(archived)
    } else {
        git(&["describe", "--always", "--abbrev=40", "--dirty", "--exclude=*"])
    };
    if let Some(commit) = commit.filter(|commit| is_hash(commit)) {
        println!("cargo::rustc-env=RAMPHOLD_COMMIT={commit}");
        println!("cargo::rustc-env=RAMPHOLD_BUILT_FROM={commit}");
    }
}

/// The optional parts that are built in, as text.
fn features() -> String {
    let parts = ["matlab", "parquet", "terminal", "tls"];
    let built = |part: &&str| std::env::var_os(format!("CARGO_FEATURE_{}", part.to_uppercase())).is_some();
    let built: Vec<&str> = parts.into_iter().filter(built).collect();
    if built.is_empty() { "no optional parts".to_owned() } else { format!("with {}", built.join(", ")) }
}

/// The output of a git command; `None` without git, or outside a repository of this project.
fn git(arguments: &[&str]) -> Option<String> {
    let here = std::env::var("CARGO_MANIFEST_DIR").ok()?;
    let ask = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).current_dir(&here).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
        (output.status.success() && !text.is_empty()).then_some(text)
    };
    // A copy inside another repository must not take the commit of that repository.
    let top = std::fs::canonicalize(ask(&["rev-parse", "--show-toplevel"])?).ok()?;
    (top == std::fs::canonicalize(&here).ok()?).then(|| ask(arguments))?
}
