//! A full disk and a read-only disk: the program says so, and a session that was begun stays readable.
//!
//! The disks are mounted in a mount namespace of their own, which the kernel must allow: to everybody, or to root.

#![cfg(target_os = "linux")]

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::Command;

use ramphold::dataset::{self, Status};

use crate::workspace::{PROGRAM, QUICK, Workspace, files};

/// Exit code of a script whose mount failed.
const NOT_MOUNTED: i32 = 77;

/// Runs a shell script in a mount namespace of its own; its exit code and standard error.
///
/// The script's arguments are `$1`, `$2`, ...; it ends with `NOT_MOUNTED` if it cannot mount its disk.
fn in_mount_namespace(script: &str, arguments: &[&Path]) -> (Option<i32>, String) {
    // The first way needs no privilege where the kernel lets anybody make a user namespace; the second needs root.
    for namespaces in [&["--user", "--map-root-user", "--mount"][..], &["--mount"]] {
        let output = Command::new("unshare")
            .args(namespaces)
            .args(["sh", "-c", script, "sh"])
            .args(arguments.iter().map(|path| OsStr::new(*path)))
            .output()
            .expect("unshare, of the package util-linux");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.code() != Some(NOT_MOUNTED) && !message.starts_with("unshare:") {
            return (output.status.code(), message);
        }
    }
    panic!(
        "the kernel lets this user mount nothing; run the test as root, or set kernel.unprivileged_userns_clone=1 \
         (and kernel.apparmor_restrict_unprivileged_userns=0) with sysctl"
    )
}

#[test]
fn a_full_disk_is_an_error_that_says_so_and_the_trials_so_far_can_be_read() {
    let workspace = Workspace::new();
    let mount = workspace.path("disk");
    fs::create_dir(&mount).unwrap();
    // The session is copied out: the disk disappears with its namespace.
    let script = r#"mount -t tmpfs -o size=2m tmpfs "$1" || exit 77
        "$2" run "$3" --seed 7 --out "$1/s"; code=$?; cp -r "$1/s" "$4"; exit $code"#;
    let (code, message) =
        in_mount_namespace(script, &[&mount, Path::new(PROGRAM), Path::new(QUICK), &workspace.path("copy")]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("cannot be written") && message.contains("Make room on the disk"), "{message}");
    let session = dataset::load(&workspace.path("copy")).unwrap();
    assert!(!session.trials.is_empty() && session.trials.iter().all(|trial| trial.status == Status::Ok));
}

#[test]
fn results_that_find_no_room_are_an_error_and_the_session_stays_as_it_was() {
    let workspace = Workspace::new();
    workspace.call(0, &["run", QUICK, "--seed", "7", "--out", "s"]);
    let session = workspace.path("s");
    let before = files(&session);
    for options in ["size=4k", "ro"] {
        let mount = workspace.path(options);
        fs::create_dir(&mount).unwrap();
        let script =
            format!(r#"mount -t tmpfs -o {options} tmpfs "$1" || exit 77; "$2" fit "$3" --out "$1/results""#);
        let (code, message) = in_mount_namespace(&script, &[&mount, Path::new(PROGRAM), &session]);
        assert_eq!(code, Some(1), "{message}");
        assert!(message.contains("results") && message.contains("cannot be written"), "{message}");
        assert!(files(&session) == before);
    }
}

#[test]
fn a_folder_that_is_read_only_is_an_error_that_names_it() {
    let workspace = Workspace::new();
    let mount = workspace.path("disk");
    fs::create_dir(&mount).unwrap();
    let script = r#"mount -t tmpfs -o ro tmpfs "$1" || exit 77; "$2" run "$3" --seed 7 --out "$1/s""#;
    let (code, message) = in_mount_namespace(script, &[&mount, Path::new(PROGRAM), Path::new(QUICK)]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("/disk/") && message.contains("cannot be written"), "{message}");
}

#[test]
fn a_session_on_a_read_only_disk_can_be_replayed_but_not_resumed() {
    let workspace = Workspace::with_short_protocol();
    let session = workspace.killed_session();
    let script = r#"mount --bind "$1" "$1" && mount -o remount,bind,ro "$1" || exit 77
        "$2" replay "$1" || exit 78
        "$2" resume "$1" --yes"#;
    let (code, message) = in_mount_namespace(script, &[&session, Path::new(PROGRAM)]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("cannot be written"), "{message}");
    workspace.call(0, &["resume", "s", "--yes"]);
}
