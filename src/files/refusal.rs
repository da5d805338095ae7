//! Why a file is not opened although the operating system would open it.

use std::io;

/// Reason for which a file or folder is refused. Comes as the inner error of an [`io::Error`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FileRefusal {
    /// A symbolic link.
    #[error("it is a symbolic link; expected a plain file or folder. Put what it leads to in its place")]
    Link,
    /// A FIFO, a socket, a device, or a folder where a file belongs.
    #[error("it is {0}; expected a plain file. Put the file itself in its place")]
    NotAFile(&'static str),
    /// Something else where a folder belongs.
    #[error("it is {0}; expected a folder. Put the folder itself in its place")]
    NotAFolder(&'static str),
    /// A file with more bytes than its kind may have.
    #[error(
        "it has more than {limit} bytes; expected at most that. Put the file as it was written in its place"
    )]
    TooLarge {
        /// Limit, bytes.
        limit: u64,
    },
    /// A folder with more entries than a session may have.
    #[error(
        "it has more than {limit} files and folders in it; expected at most that. Take away what is not of the session"
    )]
    TooMany {
        /// Limit.
        limit: usize,
    },
    /// Folders in folders in folders.
    #[error(
        "its folders are nested more than {limit} deep; expected at most that. Take away what is not of the session"
    )]
    TooDeep {
        /// Limit.
        limit: usize,
    },
    /// A file that would be appended to has a second name, under which another program may know it.
    #[error(
        "it has a second name (a hard link), under which it would change too; expected a file of its own. Copy the session"
    )]
    SharedFile,
    /// A name that leads out of the folder.
    #[error("it leads out of the folder; expected a path inside it")]
    Outside,
}

impl From<FileRefusal> for io::Error {
    fn from(refusal: FileRefusal) -> Self {
        Self::new(io::ErrorKind::InvalidInput, refusal)
    }
}

/// Whether an error is a [`FileRefusal`], so that the input is to blame and not the disk.
pub fn is_refusal(error: &io::Error) -> bool {
    error.get_ref().is_some_and(|inner| inner.is::<FileRefusal>())
}
