//! What a file is opened for.

/// Purpose for which a file is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Reading a file that is there.
    Read,
    /// Appending to a file that is there.
    Append,
    /// Appending to a file that was not there.
    CreateNew,
}
