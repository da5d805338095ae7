//! What a name in a folder stands for.

use super::refusal::FileRefusal;

/// What a name stands for, links not followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntryKind {
    /// A plain file.
    File,
    /// A folder.
    Folder,
    /// A symbolic link.
    Link,
    /// A FIFO, a socket or a device, in the words of a message.
    Other(&'static str),
}

impl EntryKind {
    /// Refuses everything but a plain file.
    pub(super) fn check_file(self) -> Result<(), FileRefusal> {
        match self {
            Self::File => Ok(()),
            Self::Link => Err(FileRefusal::Link),
            Self::Folder => Err(FileRefusal::NotAFile("a folder")),
            Self::Other(kind) => Err(FileRefusal::NotAFile(kind)),
        }
    }

    /// Refuses everything but a folder.
    pub(super) fn check_folder(self) -> Result<(), FileRefusal> {
        match self {
            Self::Folder => Ok(()),
            Self::Link => Err(FileRefusal::Link),
            Self::File => Err(FileRefusal::NotAFolder("a file")),
            Self::Other(kind) => Err(FileRefusal::NotAFolder(kind)),
        }
    }
}
