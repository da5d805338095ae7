//! Reading a text file of a session folder without leaving the folder, and a table out of it.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use super::error::{DatasetError, FilePlace};
use crate::files::{FileRefusal, Folder, excerpt, limits};

/// A session folder that is being read; no file outside it is ever opened.
#[derive(Debug, Clone)]
pub(super) struct SessionFolder(Folder);

impl SessionFolder {
    /// Opens the folder.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let at = || FilePlace::file(path.display().to_string());
        let expected = "a session folder with session.json, trials.csv and the records";
        match Folder::open(path) {
            Ok(folder) => Ok(Self(folder)),
            Err(error) if error.kind() == ErrorKind::NotADirectory => Err(DatasetError::Value {
                at: at(),
                found: "a file".to_owned(),
                expected: expected.to_owned(),
            }),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                Err(DatasetError::Missing { at: at(), expected: expected.to_owned() })
            }
            Err(source) => Err(DatasetError::Unreadable { at: at(), source }),
        }
    }

    /// The folder itself.
    pub fn folder(&self) -> &Folder {
        &self.0
    }

    /// How a file of the folder is called in messages.
    pub fn name(&self, file: &str) -> String {
        self.0.path_of(file).display().to_string()
    }

    /// The text of `file`, a path with `/` inside the folder, of at most `limit` bytes; `named_at` is who asks for it.
    ///
    /// A byte order mark at the start is taken off: spreadsheets write it.
    pub fn text(&self, file: &str, limit: u64, named_at: Option<&FilePlace>) -> Result<String, DatasetError> {
        let mut bytes = self.0.read(file, limit).map_err(|error| {
            let refusal = error.get_ref().and_then(|inner| inner.downcast_ref::<FileRefusal>());
            match (error.kind(), refusal) {
                (ErrorKind::NotFound | ErrorKind::NotADirectory, _) => {
                    let expected = match named_at {
                        Some(place) => format!("a file of the session, which {place} names"),
                        None if file == "session.json" => {
                            "it in every session folder; is this one?".to_owned()
                        }
                        None => "a file of the session".to_owned(),
                    };
                    DatasetError::Missing { at: FilePlace::file(self.name(file)), expected }
                }
                (_, Some(FileRefusal::Outside)) => {
                    let at = named_at.cloned().unwrap_or_else(|| FilePlace::file(self.name(file)));
                    DatasetError::Outside { at, found: excerpt(file).into_owned() }
                }
                _ => self.unreadable(file, error),
            }
        })?;
        if bytes.starts_with(b"\xEF\xBB\xBF") {
            bytes.drain(..3);
        }
        String::from_utf8(bytes).map_err(|error| {
            let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = 1 + good.iter().filter(|&&byte| byte == b'\n').count() as u64;
            DatasetError::NotText { at: FilePlace::line(self.name(file), line) }
        })
    }

    /// A file of the folder that cannot be read.
    pub fn unreadable(&self, file: &str, source: std::io::Error) -> DatasetError {
        DatasetError::Unreadable { at: FilePlace::file(self.name(file)), source }
    }
}

/// Opens the folder of a session, which must have a description.
///
/// # Errors
/// If it is no session folder.
pub fn open_session(path: &Path) -> Result<Folder, DatasetError> {
    let folder = SessionFolder::open(path)?;
    folder.text("session.json", limits::SETTINGS_BYTES, None)?;
    Ok(folder.0)
}

/// A table with a header line, read row by row.
pub(super) struct CsvTable<'text> {
    file: String,
    reader: csv::Reader<&'text [u8]>,
    header: Vec<String>,
    places: BTreeMap<String, usize>,
    row: csv::StringRecord,
}

impl<'text> CsvTable<'text> {
    /// Reads the header of `text`; `file` is its name for messages.
    pub fn new(file: String, text: &'text str, expected: &str) -> Result<Self, DatasetError> {
        if text.trim().is_empty() {
            return Err(DatasetError::Empty { at: FilePlace::file(file), expected: expected.to_owned() });
        }
        // Row lengths are checked here, so that the message can name the line.
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let header: Vec<String> = match reader.headers() {
            Ok(header) => header.iter().map(|name| name.trim().to_owned()).collect(),
            Err(_) => return Err(DatasetError::NotText { at: FilePlace::line(file, 1) }),
        };
        if header.len() > limits::MAX_COLUMNS {
            return Err(DatasetError::TooMany {
                at: FilePlace::line(file, 1),
                what: "columns",
                limit: limits::MAX_COLUMNS,
            });
        }
        let mut places = BTreeMap::new();
        for (place, name) in header.iter().enumerate() {
            if places.insert(name.clone(), place).is_some() && !name.is_empty() {
                return Err(DatasetError::Column {
                    at: FilePlace::line(file, 1),
                    column: excerpt(name).into_owned(),
                    problem: "there twice",
                    header: excerpt(&header.join(",")).into_owned(),
                });
            }
        }
        Ok(Self { file, reader, header, places, row: csv::StringRecord::new() })
    }

    /// Where `column` is, if it is there.
    pub fn find(&self, column: &str) -> Option<usize> {
        self.places.get(column).copied()
    }

    /// Where `column` is, which must be there.
    pub fn column(&self, column: &str) -> Result<usize, DatasetError> {
        self.find(column).ok_or_else(|| DatasetError::Column {
            at: FilePlace::line(self.file.clone(), 1),
            column: column.to_owned(),
            problem: "missing",
            header: excerpt(&self.header.join(",")).into_owned(),
        })
    }

    /// The names of the columns.
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// Goes to the next row; `false` at the end. Blank lines are passed over.
    pub fn next_row(&mut self) -> Result<bool, DatasetError> {
        let more = self.reader.read_record(&mut self.row);
        match more {
            Ok(true) if self.row.len() != self.header.len() => Err(DatasetError::FieldCount {
                at: FilePlace::line(self.file.clone(), self.line()),
                found: self.row.len(),
                expected: self.header.len(),
            }),
            Ok(more) => Ok(more),
            Err(_) => Err(DatasetError::NotText { at: FilePlace::line(self.file.clone(), self.line()) }),
        }
    }

    /// Line of the present row.
    pub fn line(&self) -> u64 {
        self.row.position().map_or(1, csv::Position::line)
    }

    /// A cell of the present row, without blanks around it.
    pub fn text(&self, column: usize) -> &str {
        self.row.get(column).unwrap_or_default().trim()
    }

    /// A cell that holds a finite number.
    pub fn number(&self, column: usize) -> Result<f64, DatasetError> {
        // Few numbers have blanks around them, and looking for blanks takes as long as reading digits.
        let cell = self.row.get(column).unwrap_or_default();
        match cell.parse::<f64>().or_else(|_| cell.trim().parse()) {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.invalid(column, "a finite number, with a point")),
        }
    }

    /// A cell that holds a whole number from 1 up.
    pub fn count(&self, column: usize) -> Result<u32, DatasetError> {
        match self.text(column).parse::<u32>() {
            Ok(value) if value > 0 => Ok(value),
            _ => Err(self.invalid(column, "a whole number from 1 up")),
        }
    }

    /// File, line and column of a cell of the present row.
    pub fn place(&self, column: usize) -> FilePlace {
        FilePlace::cell(self.file.clone(), self.line(), format!("column {}", excerpt(&self.header[column])))
    }

    /// The error for a cell of the present row that is not as `expected`.
    pub fn invalid(&self, column: usize, expected: &str) -> DatasetError {
        DatasetError::Value {
            at: self.place(column),
            found: excerpt(self.text(column)).into_owned(),
            expected: expected.to_owned(),
        }
    }
}
