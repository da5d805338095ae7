//! The files of recorded streams in a session's folder, until they are cut into the trials.

use std::io;
use std::path::Path;

use crate::files::{EntryKind, Folder};

/// Folder of the recorded streams in a session.
pub const STREAMS: &str = "streams";

/// Ending of their files.
const ENDING: &str = ".xdf";

/// A recorded stream in a session's folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamFileName {
    /// Its path in the session's folder.
    pub file: String,
    /// Name of the stream as that of a file.
    pub stem: String,
    /// The run of the program on the session that recorded it, from 1.
    pub run: usize,
}

/// Name of the file of a stream in the `run`th run of the program on a session, counted from 1.
pub fn stream_file_name(stem: &str, run: usize) -> String {
    format!("{stem}.run-{run}{ENDING}")
}

/// The recorded streams in the folder of `session`, in alphabetical order.
///
/// # Errors
/// If the folder cannot be read.
pub fn stream_files(session: &Path) -> io::Result<Vec<StreamFileName>> {
    let folder = match Folder::open(session)?.folder(STREAMS) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        opened => opened?,
    };
    let entries = folder.entries()?.into_iter().filter(|entry| entry.kind == EntryKind::File);
    let mut names: Vec<String> = entries.filter_map(|entry| entry.name.into_string().ok()).collect();
    names.sort();
    Ok(names.iter().filter_map(|name| of_name(name)).collect())
}

fn of_name(name: &str) -> Option<StreamFileName> {
    let (stem, run) = name.strip_suffix(ENDING)?.rsplit_once(".run-")?;
    Some(StreamFileName { file: format!("{STREAMS}/{name}"), stem: stem.to_owned(), run: run.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_file_tells_its_stream_and_its_run() {
        let own = of_name(&stream_file_name("EMG.run-x", 12)).unwrap();
        assert_eq!((own.stem.as_str(), own.run), ("EMG.run-x", 12));
        assert_eq!(own.file, "streams/EMG.run-x.run-12.xdf");
        assert!(of_name("EMG.xdf").is_none() && of_name("EMG.run-1.xdf.part").is_none());
    }
}
