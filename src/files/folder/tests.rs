//! A folder of a stranger: links, FIFOs, devices and sizes.

use std::fs;
use std::os::unix::fs::symlink;

use rustix::fs::{CWD, FileType, Mode, mknodat};

use super::*;
use crate::files::is_refusal;

struct Place {
    place: tempfile::TempDir,
    folder: Folder,
}

/// `inside/` with a file and what the test puts there, and `outside/victim` beside it.
fn place() -> Place {
    let place = tempfile::tempdir().unwrap();
    fs::create_dir_all(place.path().join("inside/results")).unwrap();
    fs::create_dir(place.path().join("outside")).unwrap();
    fs::write(place.path().join("outside/victim"), "precious").unwrap();
    fs::write(place.path().join("inside/results/fit.csv"), "a,b\n").unwrap();
    let folder = Folder::open(&place.path().join("inside")).unwrap();
    Place { place, folder }
}

impl Place {
    fn link(&self, target: &str, name: &str) {
        symlink(target, self.place.path().join("inside").join(name)).unwrap();
    }

    fn victim(&self) -> String {
        fs::read_to_string(self.place.path().join("outside/victim")).unwrap()
    }
}

fn refusal<T: std::fmt::Debug>(done: io::Result<T>) -> FileRefusal {
    let error = done.unwrap_err();
    assert!(is_refusal(&error), "{error}");
    error.get_ref().unwrap().downcast_ref::<FileRefusal>().unwrap().clone()
}

#[test]
fn nothing_is_opened_through_a_link() {
    let there = place();
    there.link("../outside/victim", "file");
    there.link("../outside", "folder");
    there.link("results", "own");
    let folder = &there.folder;
    for name in ["file", "folder/victim", "own/fit.csv", "./folder/../folder/victim"] {
        assert_eq!(refusal(folder.read(name, 100)), FileRefusal::Link, "{name}");
        assert_eq!(refusal(folder.append_to(name)), FileRefusal::Link, "{name}");
    }
    assert_eq!(refusal(folder.folder("folder")), FileRefusal::Link);
    assert_eq!(refusal(folder.folder_made("folder")), FileRefusal::Link);
    assert_eq!(refusal(folder.write("folder/new", b"x")), FileRefusal::Link);
    assert_eq!(refusal(folder.remove("folder/victim")), FileRefusal::Link);
    assert_eq!(refusal(folder.rename("results/fit.csv", "folder/fit.csv")), FileRefusal::Link);
    // The name of a whole file is taken from the link; what it led to stays.
    folder.write("file", b"own").unwrap();
    assert_eq!((folder.read("file", 100).unwrap(), there.victim()), (b"own".to_vec(), "precious".to_owned()));
}

#[test]
fn nothing_outside_is_named() {
    let there = place();
    for name in ["..", "../outside/victim", "/etc/hostname", "results/../../outside/victim", ""] {
        assert_eq!(refusal(there.folder.read(name, 100)), FileRefusal::Outside, "{name}");
    }
    assert_eq!(there.folder.read("./results/../results/fit.csv", 100).unwrap(), b"a,b\n");
}

#[test]
fn a_fifo_a_socket_and_a_folder_are_no_files_and_hold_nobody_up() {
    let there = place();
    let path = |name: &str| there.place.path().join("inside").join(name);
    mknodat(CWD, path("fifo"), FileType::Fifo, Mode::from_raw_mode(0o666), 0).unwrap();
    let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
    for (name, word) in [("fifo", "a FIFO"), ("socket", "a socket"), ("results", "a folder")] {
        assert_eq!(refusal(there.folder.read(name, 100)), FileRefusal::NotAFile(word));
        assert_eq!(refusal(there.folder.append_to(name)), FileRefusal::NotAFile(word));
        assert_eq!(
            refusal(super::super::given::read(&path(name), 100).map(drop).map_err(|error| {
                // A socket cannot be opened at all.
                if is_refusal(&error) { error } else { FileRefusal::NotAFile(word).into() }
            })),
            FileRefusal::NotAFile(word)
        );
    }
    assert_eq!(refusal(there.folder.folder("fifo")), FileRefusal::NotAFolder("a FIFO"));
    assert_eq!(
        refusal(super::super::given::read(Path::new("/dev/zero"), 100)),
        FileRefusal::NotAFile("a device")
    );
}

#[test]
fn a_file_is_read_up_to_its_limit() {
    let there = place();
    assert_eq!(there.folder.read("results/fit.csv", 4).unwrap(), b"a,b\n");
    assert_eq!(refusal(there.folder.read("results/fit.csv", 3)), FileRefusal::TooLarge { limit: 3 });
    // A file with a hole takes no room on the disk.
    let sparse = fs::File::create(there.place.path().join("inside/sparse")).unwrap();
    sparse.set_len(1 << 40).unwrap();
    assert_eq!(refusal(there.folder.read("sparse", 1 << 20)), FileRefusal::TooLarge { limit: 1 << 20 });
}

#[test]
fn a_file_with_a_second_name_is_not_appended_to() {
    let there = place();
    fs::hard_link(there.place.path().join("outside/victim"), there.place.path().join("inside/journal.log"))
        .unwrap();
    assert_eq!(refusal(there.folder.append_to("journal.log")), FileRefusal::SharedFile);
    assert_eq!(there.folder.read("journal.log", 100).unwrap(), b"precious");
}

#[test]
fn a_tree_is_listed_without_following_links_and_has_limits() {
    let there = place();
    there.link("..", "up");
    let tree = there.folder.tree().unwrap();
    let listed: Vec<(&str, EntryKind)> =
        tree.iter().map(|file| (file.path.to_str().unwrap(), file.kind)).collect();
    assert_eq!(listed, [("up", EntryKind::Link), ("results/fit.csv", EntryKind::File)]);
    fs::create_dir_all(there.place.path().join("inside").join("d/".repeat(limits::MAX_DEPTH + 1))).unwrap();
    assert_eq!(refusal(there.folder.tree()), FileRefusal::TooDeep { limit: limits::MAX_DEPTH });
}

#[test]
fn what_lies_under_a_name_is_told_without_following_it() {
    let there = place();
    there.link("nowhere", "link");
    let kind = |name| there.folder.kind(name).unwrap();
    assert_eq!(
        [kind("link"), kind("results"), kind("results/fit.csv"), kind("gone"), kind("gone/too")],
        [Some(EntryKind::Link), Some(EntryKind::Folder), Some(EntryKind::File), None, None]
    );
    assert!(there.folder.contains("link") && !there.folder.contains("gone"));
}

#[test]
fn the_lock_of_a_folder_is_had_by_one_at_a_time() {
    let there = place();
    let held = there.folder.lock().unwrap();
    let other = Folder::open(there.place.path().join("inside").as_path()).unwrap();
    let (told, waits) = std::sync::mpsc::channel();
    let waiting = std::thread::spawn(move || {
        let _lock = other.lock().unwrap();
        told.send(()).unwrap();
    });
    assert!(waits.recv_timeout(std::time::Duration::from_millis(200)).is_err(), "it did not wait");
    drop(held);
    waits.recv_timeout(std::time::Duration::from_secs(60)).unwrap();
    waiting.join().unwrap();
}
