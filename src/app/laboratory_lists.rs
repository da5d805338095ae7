//! What a laboratory's folder offers for a session: subjects, protocols, rigs and calibrations. Every name is that of a line of its list;
//! files are plain files of the folder itself, without links.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::console::{ListEntry, Part};
use crate::dataset::{Subject, Wrist, sha256};
use crate::files::{EntryKind, Folder, limits};

use super::failure::Failure;

/// The table of the subjects.
const SUBJECTS: &str = "subjects.csv";
/// The folder of the calibrations.
const CALIBRATIONS: &str = "calibrations";
/// What every format of a protocol begins with.
const PROTOCOL_FORMATS: &str = "ramphold-protocol/";

/// A line of the table of subjects.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedSubject {
    /// The identifier.
    pub id: String,
    /// The hand that is measured, if the table says so.
    pub hand: Option<Wrist>,
    /// Whatever else is to be known.
    pub notes: String,
}

/// A file to choose.
#[derive(Debug, Clone, PartialEq)]
pub struct ListedFile {
    /// Its name in the list.
    pub name: String,
    /// Its path.
    pub path: PathBuf,
    /// What it says of itself.
    about: String,
    /// SHA-256 of its bytes.
    sha256: String,
}

/// What a laboratory's folder offers.
#[derive(Debug, Clone, PartialEq)]
pub struct LaboratoryLists {
    /// The subjects, or why there are none.
    pub subjects: Result<Vec<ListedSubject>, String>,
    /// Files of protocols.
    pub protocols: Vec<ListedFile>,
    /// Files of rigs.
    pub rigs: Vec<ListedFile>,
    /// Files of calibrations.
    pub calibrations: Vec<ListedFile>,
}

impl LaboratoryLists {
    /// Reads the lists of the laboratory in `folder`.
    ///
    /// # Errors
    /// If the folder cannot be read, or has no table of subjects: then it is no laboratory.
    pub fn read(folder: &Path) -> Result<Self, Failure> {
        let no_laboratory = |why: &dyn std::fmt::Display| {
            let folder = folder.display();
            Failure::Usage(format!(
                "{folder}: {why}; expected the folder of a laboratory, as `ramphold new {folder}` makes it"
            ))
        };
        let own = Folder::open(folder).map_err(|error| no_laboratory(&error))?;
        if !own.contains(SUBJECTS) {
            return Err(no_laboratory(&format_args!("has no {SUBJECTS}")));
        }
        let (mut protocols, mut rigs) = (Vec::new(), Vec::new());
        for file in json_files(&own).map_err(|error| no_laboratory(&error))? {
            let stated = serde_json::from_slice::<Value>(&file.bytes).ok();
            let text = |field: &str| stated.as_ref()?.get(field)?.as_str().map(str::to_owned);
            // A file that is no JSON goes by its name, so that its check says what is wrong with it.
            let is_rig =
                stated.as_ref().map_or(file.name.starts_with("rig"), |json| json.get("kind").is_some());
            let is_protocol = !is_rig
                && (stated.is_none()
                    || text("format").is_some_and(|format| format.starts_with(PROTOCOL_FORMATS)));
            if is_rig {
                let about = text("name").or_else(|| text("kind").map(|kind| format!("{kind} rig")));
                rigs.push(file.listed(about));
            } else if is_protocol {
                protocols.push(file.listed(text("name")));
            }
        }
        let calibrations = match own.folder(CALIBRATIONS) {
            Ok(folder) => json_files(&folder).map_err(|error| no_laboratory(&error))?,
            Err(_) => Vec::new(),
        };
        let listed = |file: JsonFile| {
            let stated = serde_json::from_slice::<Value>(&file.bytes).unwrap_or_default();
            let measured = stated.get("measured_utc").and_then(Value::as_str);
            file.listed(measured.map(|measured| format!("measured {measured}")))
        };
        Ok(Self {
            subjects: subjects(&own),
            protocols,
            rigs,
            calibrations: calibrations.into_iter().map(listed).collect(),
        })
    }

    /// The lines of a list.
    pub fn entries(&self, part: Part) -> Vec<ListEntry> {
        if part == Part::Subject {
            let subjects = self.subjects.iter().flatten();
            return subjects.map(|own| ListEntry { name: own.id.clone(), about: own.about() }).collect();
        }
        let files = self.files(part).iter();
        files.map(|file| ListEntry { name: file.name.clone(), about: file.about.clone() }).collect()
    }

    /// The subject of that name.
    pub fn subject(&self, name: &str) -> Option<&ListedSubject> {
        self.subjects.as_ref().ok()?.iter().find(|subject| subject.id == name)
    }

    /// The file of that name.
    pub fn file(&self, part: Part, name: &str) -> Option<&ListedFile> {
        self.files(part).iter().find(|file| file.name == name)
    }

    fn files(&self, part: Part) -> &[ListedFile] {
        match part {
            Part::Subject => &[],
            Part::Protocol => &self.protocols,
            Part::Rig => &self.rigs,
            Part::Calibration => &self.calibrations,
        }
    }
}

impl ListedSubject {
    fn about(&self) -> String {
        let hand = self.hand.map(|hand| match hand {
            Wrist::Left => "left hand",
            Wrist::Right => "right hand",
        });
        let notes = Some(self.notes.as_str()).filter(|notes| !notes.is_empty());
        hand.into_iter().chain(notes).collect::<Vec<_>>().join(", ")
    }
}

/// A JSON file as it is read.
struct JsonFile {
    name: String,
    path: PathBuf,
    bytes: Vec<u8>,
}

impl JsonFile {
    fn listed(self, about: Option<String>) -> ListedFile {
        let about = about.unwrap_or_default();
        ListedFile { about, sha256: sha256(&self.bytes), name: self.name, path: self.path }
    }
}

/// The JSON files of a folder that can be read, in natural order of their names.
fn json_files(folder: &Folder) -> std::io::Result<Vec<JsonFile>> {
    let mut found = Vec::new();
    for entry in folder.entries()? {
        let Ok(name) = entry.name.into_string() else { continue };
        if entry.kind != EntryKind::File || !name.ends_with(".json") {
            continue;
        }
        // One that is being written just now is there at the next look.
        let Ok(bytes) = folder.read(&name, limits::SETTINGS_BYTES) else { continue };
        found.push(JsonFile { path: folder.path_of(&name), name, bytes });
    }
    found.sort_by(|a, b| natord::compare(&a.name, &b.name));
    Ok(found)
}

/// The subjects of the table, or what is wrong with it.
fn subjects(folder: &Folder) -> Result<Vec<ListedSubject>, String> {
    let text =
        folder.read_text(SUBJECTS, limits::SETTINGS_BYTES).map_err(|error| format!("{SUBJECTS}: {error}"))?;
    let mut table =
        csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(text.as_bytes());
    let heads = table.headers().map_err(|error| format!("{SUBJECTS}: {error}"))?.clone();
    let column = |name: &str| heads.iter().position(|head| head == name);
    let Some(id_column) = column("subject") else {
        return Err(format!(
            "{SUBJECTS}: has no column subject; expected the columns subject, hand and notes"
        ));
    };
    let (hand_column, notes_column) = (column("hand"), column("notes"));
    let mut subjects: Vec<ListedSubject> = Vec::new();
    for row in table.records() {
        let row = row.map_err(|error| format!("{SUBJECTS}: {error}"))?;
        let line = row.position().map_or(0, csv::Position::line);
        let cell = |column: Option<usize>| column.and_then(|column| row.get(column)).unwrap_or_default();
        let id = cell(Some(id_column));
        if !Subject::is_identifier(id) {
            return Err(format!(
                "{SUBJECTS}, line {line}, column subject: {id:?}; expected letters, digits, -, _ and . such as S01"
            ));
        }
        if subjects.iter().any(|own| own.id == id) {
            return Err(format!(
                "{SUBJECTS}, line {line}, column subject: {id} is there twice; remove one of the lines"
            ));
        }
        let hand = match cell(hand_column) {
            "" => None,
            "left" => Some(Wrist::Left),
            "right" => Some(Wrist::Right),
            other => {
                return Err(format!(
                    "{SUBJECTS}, line {line}, column hand: {other:?}; expected left, right or nothing"
                ));
            }
        };
        subjects.push(ListedSubject { id: id.to_owned(), hand, notes: cell(notes_column).to_owned() });
    }
    Ok(subjects)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn laboratory(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
            fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    fn names(files: &[ListedFile]) -> Vec<&str> {
        files.iter().map(|file| file.name.as_str()).collect()
    }

    #[test]
    fn a_file_is_in_the_list_of_what_it_says_it_is_and_a_broken_one_in_that_of_its_name() {
        let folder = laboratory(&[
            ("subjects.csv", "subject\nS01\n"),
            ("protocol.json", r#"{ "format": "ramphold-protocol/1", "name": "ten" }"#),
            ("protocol-2.json", r#"{ "format": "ramphold-protocol/1" }"#),
            ("protocol-10.json", "{ broken"),
            ("motor.json", r#"{ "kind": "can", "name": "the motor" }"#),
            ("rig.json", "broken"),
            ("model.json", r#"{ "mechanisms": [] }"#),
            ("notes.txt", "{}"),
            ("calibrations/monday.json", r#"{ "measured_utc": "2026-11-23T08:00:00Z" }"#),
            ("sessions/one/protocol.json", r#"{ "format": "ramphold-protocol/1" }"#),
        ]);
        let lists = LaboratoryLists::read(folder.path()).unwrap();
        assert_eq!(names(&lists.protocols), ["protocol-2.json", "protocol-10.json", "protocol.json"]);
        assert_eq!(names(&lists.rigs), ["motor.json", "rig.json"]);
        assert_eq!(names(&lists.calibrations), ["monday.json"]);
        assert_eq!(lists.entries(Part::Rig)[0].about, "the motor");
        assert_eq!(lists.entries(Part::Calibration)[0].about, "measured 2026-11-23T08:00:00Z");
    }

    /// A link may lead anywhere, and the list of a folder is what lies in it.
    #[cfg(unix)]
    #[test]
    fn a_link_is_not_in_the_lists() {
        let elsewhere = laboratory(&[("rig.json", r#"{ "kind": "virtual" }"#)]);
        let folder = laboratory(&[("subjects.csv", "subject\nS01\n")]);
        std::os::unix::fs::symlink(elsewhere.path().join("rig.json"), folder.path().join("rig.json"))
            .unwrap();
        std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("calibrations")).unwrap();
        let lists = LaboratoryLists::read(folder.path()).unwrap();
        assert_eq!((lists.rigs, lists.calibrations), (Vec::new(), Vec::new()));
    }

    #[test]
    fn a_table_of_subjects_is_read_or_refused_with_its_line() {
        let read = |table: &str| {
            LaboratoryLists::read(laboratory(&[("subjects.csv", table)]).path()).unwrap().subjects
        };
        let subjects = read("notes,subject,hand\nlate,S01,right\n,S02,\n").unwrap();
        assert_eq!(
            subjects[0],
            ListedSubject { id: "S01".into(), hand: Some(Wrist::Right), notes: "late".into() }
        );
        assert_eq!(subjects[1].hand, None);
        assert_eq!(read("subject,hand\n").unwrap(), []);
        for (table, words) in [
            ("hand\nleft\n", "no column subject"),
            ("subject\nS01\n../S02\n", "line 3, column subject: \"../S02\""),
            ("subject\nS01\nS02\nS01\n", "line 4, column subject: S01 is there twice"),
            ("subject,hand\nS01,lefty\n", "line 2, column hand: \"lefty\""),
            ("", "no column subject"),
        ] {
            let why = read(table).unwrap_err();
            assert!(why.starts_with("subjects.csv") && why.contains(words), "{table:?}: {why}");
        }
    }

    #[test]
    fn a_folder_without_subjects_is_no_laboratory() {
        let folder = laboratory(&[("protocol.json", "{}")]);
        for path in
            [folder.path().to_owned(), folder.path().join("nowhere"), folder.path().join("protocol.json")]
        {
            let why = LaboratoryLists::read(&path).unwrap_err();
            assert!(why.to_string().contains("expected the folder of a laboratory"), "{why}");
            assert_eq!(why.exit_code(), 2);
        }
    }
}
