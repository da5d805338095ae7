//! Options whose part is not built are refused with the command that builds it. A build with all features has no such option.

#[cfg(not(feature = "matlab"))]
#[test]
fn an_nwb_file_is_refused_without_the_feature() {
    use crate::workspace::{QUICK, Workspace};
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "1", "--out", "s"]);
    let (_, message) = workspace.call(2, &["export", "s", "--nwb", "s.nwb"]);
    assert!(message.contains("cargo build --release --features matlab"), "{message}");
    assert!(!workspace.path("s.nwb").exists());
}

#[cfg(not(feature = "parquet"))]
#[test]
fn a_parquet_table_is_refused_without_the_feature() {
    use crate::workspace::{QUICK, Workspace};
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "1", "--out", "s"]);
    let (_, message) = workspace.call(2, &["export", "s", "--parquet", "samples.parquet"]);
    assert!(message.contains("cargo build --release --features parquet"), "{message}");
    assert!(!workspace.path("samples.parquet").exists());
}

#[cfg(not(feature = "terminal"))]
#[test]
fn the_console_in_a_terminal_is_refused_without_the_feature() {
    use crate::workspace::{QUICK, Workspace};
    let workspace = Workspace::new();
    let (_, message) = workspace.call(2, &["run", QUICK, "--tui", "--out", "s"]);
    assert!(message.contains("cargo build --release --features terminal"), "{message}");
    assert!(!workspace.path("s").exists());
}

#[cfg(not(feature = "tls"))]
#[test]
fn encrypted_pages_are_refused_without_the_feature() {
    use crate::workspace::{QUICK, Workspace};
    let workspace = Workspace::new();
    let certificate = ["--tls-cert", "cert.pem", "--tls-key", "key.pem"];
    let (_, message) =
        workspace.call(2, &[&["run", QUICK, "--console", "--out", "s"][..], &certificate].concat());
    assert!(message.contains("cargo build --release --features tls"), "{message}");
    assert!(!workspace.path("s").exists());
}
