//! What is built into the program, held against `deny.toml` without a network: licences, sources, duplicates.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// The strings of a list in `deny.toml`.
fn list(name: &str) -> BTreeSet<String> {
    let text = include_str!("../../deny.toml");
    let start = text.find(&format!("\n{name} = [")).unwrap_or_else(|| panic!("deny.toml has no {name}"));
    let body = text[start..].split_once('[').unwrap().1.split_once(']').unwrap().0;
    body.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Every package that is built on this platform, the tests' own included, with what cargo knows of it. They are all on this
/// machine, or this test would not have been built; `scripts/supply-chain` looks at those of other platforms, too.
fn packages() -> Vec<Value> {
    let rustc = Command::new("rustc").arg("-vV").output().unwrap();
    let rustc = String::from_utf8(rustc.stdout).unwrap();
    let host = rustc.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--offline", "--locked", "--format-version", "1", "--filter-platform", host])
        .args(["--manifest-path", concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap().clone();
    assert!(packages.len() > 50, "{} packages", packages.len());
    packages
}

/// Whether a licence expression can be kept to with the licences allowed.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    // `/` is the old way to write OR. Brackets come around alternatives only.
    let expression = expression.replace('/', " OR ");
    let parts: Vec<&str> = expression.split(" AND ").collect();
    parts.iter().all(|part| {
        let part = part.trim_matches(|c| "() ".contains(c));
        part.split(" OR ").any(|licence| allowed.contains(licence.trim()))
    })
}

#[test]
fn every_licence_is_one_that_is_allowed() {
    let allowed = list("allow");
    for package in packages() {
        let licence = package["license"].as_str().unwrap_or("none");
        assert!(is_allowed(licence, &allowed), "{}: {licence}", package["id"]);
    }
    assert!(is_allowed("(MIT OR GPL-3.0) AND Unicode-3.0", &allowed));
    assert!(!is_allowed("GPL-3.0", &allowed) && !is_allowed("MIT AND GPL-3.0", &allowed));
}

#[test]
fn everything_comes_from_the_public_registry_with_a_checksum() {
    let lock = include_str!("../../Cargo.lock");
    for package in lock.split("[[package]]").skip(1) {
        if ["ramphold", "ramphold-python"].iter().any(|own| package.contains(&format!("name = \"{own}\""))) {
            continue;
        }
        assert!(
            package.contains("source = \"registry+https://github.com/rust-lang/crates.io-index\"")
                && package.contains("checksum = \""),
            "{package}"
        );
    }
}

#[test]
fn no_crate_is_there_in_two_versions_but_those_that_are_known() {
    let lock = include_str!("../../Cargo.lock");
    let skipped = list("skip");
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in lock.split("[[package]]").skip(1) {
        let field = |name: &str| package.split(&format!("\n{name} = \"")).nth(1)?.split('"').next();
        versions.entry(field("name").unwrap()).or_default().insert(field("version").unwrap());
    }
    let twice: BTreeSet<String> = versions
        .into_iter()
        .filter(|(_, versions)| versions.len() > 1)
        .map(|(name, _)| name.to_owned())
        .collect();
    assert_eq!(twice, skipped, "duplicates in Cargo.lock and `skip` in deny.toml are not the same");
}
