//! The folder of a laboratory: protocol, rig, subjects, and a place for calibrations and sessions.

use std::collections::HashSet;
use std::io::ErrorKind;
use std::path::Path;

use serde_json::{Value, json};

use crate::dataset::Subject;
use crate::files::{self, Folder};
use crate::protocol::{EXAMPLES, ValidProtocol};
use crate::rig::can::DryRun;
use crate::rig::can::file::ValidRigFile;
use crate::rig::unmeasured_channels;

use super::failure::Failure;
use super::session_rig::is_can_rig_file;

/// What a laboratory begins with.
#[derive(Debug, Clone, PartialEq)]
pub struct Laboratory {
    /// Text of the protocol, and where it is from.
    protocol: (String, String),
    /// Text of the rig file, and where it is from.
    rig: (String, String),
    /// Identifiers of the subjects.
    subjects: Vec<String>,
}

impl Laboratory {
    /// A laboratory with this protocol (`paper`, `quick` or a file), rig (`virtual` or a file), EMG or not, and subjects. Of a motor's
    /// rig, the file says whether it has EMG.
    ///
    /// # Errors
    /// If protocol or rig cannot be read or do not go together, or an identifier cannot be one.
    pub fn new(protocol: &str, rig: &str, emg: bool, subjects: Vec<String>) -> Result<Self, Failure> {
        if let Some(id) = subjects.iter().find(|id| !Subject::is_identifier(id)) {
            return Err(Failure::Usage(format!(
                "subject {id:?}: expected letters, digits, -, _ and . such as S01"
            )));
        }
        // Folders are named after them, and some disks take S01 and s01 for one name.
        let mut known = HashSet::new();
        if let Some(id) = subjects.iter().find(|id| !known.insert(id.to_lowercase())) {
            return Err(Failure::Usage(format!(
                "subject {id:?}: given twice; each person has an identifier"
            )));
        }
        let is_can = rig != "virtual" && is_can_rig_file(Path::new(rig));
        let text = match protocol {
            "paper" => example("de-vlugt-2011.json"),
            "quick" => example("quick.json"),
            file => ValidProtocol::read(Path::new(file))?.text().to_owned(),
        };
        let text = if emg || is_can { text } else { without_emg(&text) };
        let valid = ValidProtocol::parse(&text, protocol)?;
        let rig_text = if rig == "virtual" {
            let virtual_rig =
                if emg { json!({ "kind": "virtual" }) } else { json!({ "kind": "virtual", "emg": false }) };
            format!("{virtual_rig:#}\n")
        } else if is_can {
            let file = ValidRigFile::read(Path::new(rig))?;
            DryRun::of(&valid, &file)?;
            file.text().to_owned()
        } else {
            use crate::rig::virtual_wrist::RigFile;
            let RigFile::Virtual(setup) = RigFile::read(Path::new(rig))?;
            let missing = unmeasured_channels(&valid, [setup.emg; 2]);
            if !missing.is_empty() {
                return Err(Failure::Usage(format!("{rig} measures no EMG: {}", missing.join("; "))));
            }
            files::read_text(Path::new(rig), files::limits::SETTINGS_BYTES)
                .map_err(|source| Failure::Read { file: rig.to_owned(), source })?
        };
        Ok(Self { protocol: (text, protocol.to_owned()), rig: (rig_text, rig.to_owned()), subjects })
    }

    /// Writes it into `folder`, which must be new or empty.
    ///
    /// # Errors
    /// If the folder is not empty, or cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), Failure> {
        if files::exists(folder)
            && Folder::open(folder).is_err_and(|error| error.kind() == ErrorKind::NotADirectory)
        {
            let shown = folder.display();
            return Err(Failure::Usage(format!("{shown}: is a file; give the name of a new folder")));
        }
        let at = |source| Failure::ResultsFolder { path: folder.to_owned(), source };
        files::make_folders(folder).map_err(at)?;
        let own = Folder::open(folder).map_err(at)?;
        if !own.entries().map_err(at)?.is_empty() {
            let shown = folder.display();
            return Err(Failure::Usage(format!("{shown}: is not empty; give the name of a new folder")));
        }
        let write = || {
            for name in ["sessions", "calibrations"] {
                own.make_folder(name)?;
            }
            own.write("protocol.json", self.protocol.0.as_bytes())?;
            own.write("rig.json", self.rig.0.as_bytes())?;
            own.write("subjects.csv", self.subjects_table().as_bytes())?;
            own.write("README.md", self.readme().as_bytes())
        };
        write().map_err(at)
    }

    fn subjects_table(&self) -> String {
        let rows: String = self.subjects.iter().map(|id| format!("{id},,\n")).collect();
        format!("subject,hand,notes\n{rows}")
    }

    fn readme(&self) -> String {
        let subject = self.subjects.first().map_or("S01", String::as_str);
        let check = if self.rig.1 == "virtual" {
            String::new()
        } else {
            "    ramphold rig check rig.json --protocol protocol.json\n".to_owned()
        };
        format!(
            "# Laboratory\n\n\
             | | |\n|---|---|\n\
             | `protocol.json` | the protocol (from: {}) |\n\
             | `rig.json` | the rig (from: {}) |\n\
             | `subjects.csv` | the subjects: identifier, hand, notes |\n\
             | `calibrations/` | measured constants of the rig, one file a day |\n\
             | `sessions/` | the sessions |\n\n\
             In this folder:\n\n    ramphold check protocol.json\n{check}    \
             ramphold console\n    \
             ramphold sessions\n\n\
             `ramphold console` begins sessions in a page. Without it: \
             `ramphold run protocol.json --rig rig.json --subject {subject} --console`.\n",
            self.protocol.1, self.rig.1
        )
    }
}

/// The text of a protocol that comes with the program.
fn example(name: &str) -> String {
    let (_, text) = EXAMPLES.iter().find(|(own, _)| *own == name).expect("the program comes with it");
    (*text).to_owned()
}

/// The text of a protocol without what needs EMG: maximal efforts, and the limit of the antagonist.
fn without_emg(text: &str) -> String {
    let Ok(mut protocol) = serde_json::from_str::<Value>(text) else { return text.to_owned() };
    for (path, name) in [("before", "mvc"), ("gate", "antagonist_limit_mvc")] {
        if let Some(value) = protocol.get_mut(path).and_then(|part| part.get_mut(name)) {
            *value = Value::Null;
        }
    }
    format!("{protocol:#}\n")
}
