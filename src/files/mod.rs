//! The only place that opens, makes, renames and removes files.
//!
//! A session folder may come from a stranger. It is a tree of plain files and folders, and a [`Folder`] opens it as such:
//! every name is resolved from an open folder, one part after the other, and a symbolic link, a FIFO, a socket or a device
//! is refused wherever it lies. A new file gets a random name that was not there, and its own name once it is complete.
//! Every file has a limit of its size, see [`limits`], which holds while it is read.
//!
//! What the operator names on the command line is the operator's own: links in that path are followed, see [`read`].

mod csv_cell;
mod entry_kind;
mod folder;
mod given;
pub mod limits;
#[cfg(unix)]
mod open_at;
#[cfg(not(unix))]
#[path = "without_openat.rs"]
mod open_at;
mod plain_name;
mod purpose;
mod quoted;
mod refusal;
mod tree;
mod whole_file;

pub use csv_cell::{csv_cell, text_of_cell};
pub use entry_kind::EntryKind;
pub use folder::{Folder, FolderEntry, FolderLock};
pub use given::{exists, make_folders, open, read, read_text};
pub use plain_name::{is_plain_name, is_single_name};
pub use quoted::{excerpt, without_controls};
pub use refusal::{FileRefusal, is_refusal};
pub use tree::TreeFile;
pub use whole_file::{WholeFile, is_unfinished};
