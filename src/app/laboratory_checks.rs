//! The checks before a session of a laboratory: those of `ramphold check` and, for a motor, of `ramphold rig check --offline`.

use std::collections::BTreeMap;

use crate::console::{ListedCheck, Outcome, Part};
use crate::protocol::ValidProtocol;
use crate::schedule;
use crate::session::Settings;

use super::laboratory_lists::LaboratoryLists;
use super::{
    Failure, RequestedRig, UsedCalibration, duration_text, rig_trials_text, subject_number, trials_text,
};

/// What is chosen of each list, by the names of their lines.
pub type Chosen = BTreeMap<Part, String>;

/// Checks what is chosen. Nothing is sent on a bus.
pub fn checks(lists: &LaboratoryLists, chosen: &Chosen) -> Vec<ListedCheck> {
    let subject = subject(lists, chosen);
    let protocol = match lists.file_of(chosen, Part::Protocol) {
        Ok(file) => ValidProtocol::read(&file.path).map_err(|error| Missing::Wrong(error.to_string())),
        Err(missing) => Err(missing),
    };
    let rig = match (lists.file_of(chosen, Part::Rig), &protocol) {
        (Ok(file), Ok(protocol)) => RequestedRig::read(Some(&file.path), protocol).map_err(Missing::wrong),
        (Ok(_), Err(_)) => Err(Missing::Open("it is checked together with the protocol".to_owned())),
        (Err(missing), _) => Err(missing),
    };
    let order = match (&subject, &protocol) {
        (Ok(_), Ok(protocol)) => order(protocol, chosen).map_err(Missing::wrong),
        _ => Err(Missing::Open("it is drawn for a subject and a protocol".to_owned())),
    };
    let calibration = calibration(lists, chosen, rig.as_ref().ok());
    vec![
        check("subject", subject),
        check("protocol", protocol.map(|protocol| protocol_text(&protocol))),
        check("order of the trials", order),
        check("rig", rig.map(|rig| rig_text(&rig))),
        check("calibration", calibration),
    ]
}

/// Why a check has not passed.
enum Missing {
    /// Something else comes first.
    Open(String),
    /// It is wrong.
    Wrong(String),
}

impl Missing {
    #[allow(clippy::needless_pass_by_value, reason = "it is what map_err gives")]
    fn wrong(failure: Failure) -> Self {
        Self::Wrong(failure.to_string())
    }
}

fn check(name: &'static str, found: Result<String, Missing>) -> ListedCheck {
    let (outcome, text) = match found {
        Ok(text) => (Outcome::Passed, text),
        Err(Missing::Open(text)) => (Outcome::Open, text),
        Err(Missing::Wrong(text)) => (Outcome::Failed, text),
    };
    ListedCheck { name, outcome, text }
}

impl LaboratoryLists {
    /// The file that is chosen of a list.
    fn file_of(&self, chosen: &Chosen, part: Part) -> Result<&super::laboratory_lists::ListedFile, Missing> {
        let Some(name) = chosen.get(&part) else {
            let what = if part == Part::Rig { "rig" } else { "protocol" };
            return Err(match self.entries(part).is_empty() {
                true => Missing::Wrong(format!("there is no {what} in the folder; put its file there")),
                false => Missing::Open(format!("choose a {what}")),
            });
        };
        self.file(part, name).ok_or_else(|| Missing::Wrong(format!("{name} is not in the folder any more")))
    }
}

fn subject(lists: &LaboratoryLists, chosen: &Chosen) -> Result<String, Missing> {
    match &lists.subjects {
        Err(why) => return Err(Missing::Wrong(why.clone())),
        Ok(subjects) if subjects.is_empty() => {
            return Err(Missing::Wrong("subjects.csv has no subject; write a line for each".to_owned()));
        }
        Ok(_) => {}
    }
    match chosen.get(&Part::Subject) {
        None => Err(Missing::Open("choose a subject".to_owned())),
        Some(name) => match lists.subject(name) {
            Some(subject) if subject.hand.is_none() => Ok(format!("{name}; subjects.csv names no hand")),
            Some(_) => Ok(name.clone()),
            None => Err(Missing::Wrong(format!("{name} is not in subjects.csv any more"))),
        },
    }
}

fn protocol_text(protocol: &ValidProtocol) -> String {
    let rig_trials =
        rig_trials_text(protocol).map(|text| format!("; rig trials: {text}")).unwrap_or_default();
    format!(
        "{}. Trials: {}{rig_trials}. Expected duration: {}",
        protocol.name,
        trials_text(protocol),
        duration_text(protocol)
    )
}

/// That an order of the trials exists: only drawing shows that, with any seed.
fn order(protocol: &ValidProtocol, chosen: &Chosen) -> Result<String, Failure> {
    let number = chosen.get(&Part::Subject).and_then(|id| subject_number(id));
    let order = schedule::draw(protocol, 0, number)?;
    Settings::new(protocol, 0, &order)?;
    Ok("can be drawn for this subject".to_owned())
}

fn rig_text(rig: &RequestedRig) -> String {
    match rig {
        RequestedRig::Virtual(_) => "virtual wrist; it measures what the protocol needs".to_owned(),
        RequestedRig::Can(motor) => {
            let (rig, _) = motor.as_ref();
            let load = rig.budget().load(rig.period(), rig.bit_rate);
            format!(
                "{} on {}: every movement stays inside the limits, bus load {:.0} %. The motor itself is asked when the \
                 session begins, and has no power before you arm it",
                rig.name,
                rig.bus,
                load * 100.0
            )
        }
    }
}

fn calibration(
    lists: &LaboratoryLists,
    chosen: &Chosen,
    rig: Option<&RequestedRig>,
) -> Result<String, Missing> {
    let Some(name) = chosen.get(&Part::Calibration) else {
        return Ok(match lists.calibrations.len() {
            0 => "none; the constants are those of the rig file".to_owned(),
            count => format!("none of {count} chosen; the constants are those of the rig file"),
        });
    };
    let Some(file) = lists.file(Part::Calibration, name) else {
        return Err(Missing::Wrong(format!("{name} is not in the folder any more")));
    };
    let used = UsedCalibration::given(&file.path).map_err(Missing::wrong)?;
    let Some(rig) = rig else {
        return Err(Missing::Open("it is checked together with the rig".to_owned()));
    };
    UsedCalibration::constants(used.as_ref(), rig.lever()).map_err(Missing::wrong)?;
    Ok(format!("{name} goes with the rig"))
}
