//! A temporary folder in which a test runs the program.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

/// The program under test.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_ramphold");
/// Time after which a test gives up waiting. It is far more than anything needs, on a busy machine too.
pub const FOREVER: Duration = Duration::from_secs(600);
/// Protocol of the paper's experiment.
pub const PAPER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/de-vlugt-2011.json");
/// Protocol of a session of one minute.
pub const QUICK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/quick.json");

/// The program, with the repository as its working directory.
pub fn ramphold(arguments: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(arguments);
    command
}

/// A temporary folder; it is deleted when the test ends.
pub struct Workspace(tempfile::TempDir);

impl Workspace {
    /// An empty folder.
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// The folder itself.
    pub fn folder(&self) -> &Path {
        self.0.path()
    }

    /// The path of a file or folder in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a JSON file.
    pub fn write(&self, name: &str, value: &Value) {
        fs::write(self.path(name), format!("{value:#}\n")).unwrap();
    }

    /// The program, with the folder as its working directory.
    pub fn ramphold(&self, arguments: &[&str]) -> Command {
        let mut command = ramphold(arguments);
        command.current_dir(self.folder());
        command
    }

    /// Runs the program and checks its exit code; its standard output and error.
    #[track_caller]
    pub fn call(&self, code: i32, arguments: &[&str]) -> (String, String) {
        output_of(&mut self.ramphold(arguments), code)
    }

    /// `call` with a number of threads (0: as many as there are processors).
    #[track_caller]
    pub fn call_with_threads(&self, threads: &str, code: i32, arguments: &[&str]) -> (String, String) {
        output_of(self.ramphold(arguments).env("RAYON_NUM_THREADS", threads), code)
    }
}

/// Waits until a running program has done something.
#[track_caller]
pub fn wait_for(child: &mut Child, what: &str, done: impl Fn() -> bool) {
    let begun = Instant::now();
    while !done() {
        assert_eq!(child.try_wait().unwrap(), None, "the program ended before {what}");
        assert!(begun.elapsed() < FOREVER, "never: {what}");
        sleep(Duration::from_millis(10));
    }
}

/// Runs a command and checks its exit code; its standard output and error.
#[track_caller]
pub fn output_of(command: &mut Command, code: i32) -> (String, String) {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let (stdout, stderr) =
        (String::from_utf8_lossy(&stdout).into_owned(), String::from_utf8_lossy(&stderr).into_owned());
    assert_eq!(status.code(), Some(code), "{command:?}: {stdout}{stderr}");
    (stdout, stderr)
}

/// Every file under a folder: its path from there, and its bytes.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_string_lossy().into_owned();
                files.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// Copies a folder with everything in it.
pub fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target)
        } else {
            fs::copy(entry.path(), target).map(|_| ()).unwrap()
        }
    }
}
