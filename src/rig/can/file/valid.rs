//! Reads and checks a rig file.

use std::fs;
use std::path::Path;

use crate::protocol::Problem;
use crate::protocol::source::JsonNode;
use crate::rig::can::budget::{Budget, When};
use crate::rig::can::units::{BusPeriod, SamplePeriod};

use super::error::CanRigFileError;
use super::rig_file::{CanRigFile, MotorSettings};
use super::rules;

/// A rig file that passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidRigFile {
    file: CanRigFile,
    text: String,
    name: String,
    period: BusPeriod,
    budget: Budget,
}

impl ValidRigFile {
    /// Reads a rig file.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn read(path: &Path) -> Result<Self, CanRigFileError> {
        let file = path.display().to_string();
        let text = fs::read_to_string(path)
            .map_err(|source| CanRigFileError::Unreadable { file: file.clone(), source })?;
        Self::parse(&text, &file)
    }

    /// Reads a rig from its JSON `text`; `name` is that of the file, for messages.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn parse(text: &str, name: &str) -> Result<Self, CanRigFileError> {
        let source = JsonNode::parse(text, name).map_err(CanRigFileError::NotJson)?;
        let invalid = |problems| CanRigFileError::Invalid { file: name.to_owned(), problems };
        let file = typed(&source).map_err(|problem| invalid(vec![problem]))?;
        let mut problems = rules::problems(&file, &source);
        let (Some(period), true) = (BusPeriod::from_us(file.period_us), problems.is_empty()) else {
            problems.sort_by_key(|problem| problem.line);
            return Err(invalid(problems));
        };
        let budget = budget(&file);
        if let Some(problem) = rules::overload(&file, &budget, period, &source) {
            return Err(invalid(vec![problem]));
        }
        Ok(Self { file, text: text.to_owned(), name: name.to_owned(), period, budget })
    }

    /// The text it was read from, byte for byte.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The file as it was named.
    pub fn file_name(&self) -> &str {
        &self.name
    }

    /// Time from one SYNC to the next.
    pub fn period(&self) -> BusPeriod {
        self.period
    }

    /// Time from one sample to the next.
    pub fn sample_period(&self) -> SamplePeriod {
        self.period.with_samples(self.file.signals.torque.samples)
    }

    /// What a cycle costs on the bus.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }
}

impl std::ops::Deref for ValidRigFile {
    type Target = CanRigFile;

    fn deref(&self) -> &CanRigFile {
        &self.file
    }
}

fn typed(source: &JsonNode) -> Result<CanRigFile, Problem> {
    serde_path_to_error::deserialize(source.value()).map_err(|error| {
        let path = error.path().to_string();
        let place = source.at(&path);
        Problem {
            line: place.map_or(1, |node| node.line),
            value: place.map(ToString::to_string),
            expected: error.inner().to_string(),
            advice: "compare with the example in docs/how-to/real-motor.md".to_owned(),
            path: if path == "." { "the rig file".to_owned() } else { path },
        }
    })
}

fn budget(file: &CanRigFile) -> Budget {
    let mut budget = Budget::default();
    let own_heartbeat = u32::from(file.master.heartbeat_ms);
    budget.add("SYNC", 0, When::EachPeriod);
    budget.add("target", file.target_bytes(), When::EachPeriod);
    for frame in &file.frames {
        let name = format!("{:?}", frame.carries);
        budget.add(name.trim_matches(['[', ']']), file.frame_bytes(frame), When::EachPeriod);
    }
    budget.add("heartbeat of this program", 1, When::EveryMs(own_heartbeat));
    match &file.motor {
        MotorSettings::Cia402(motor) => {
            budget.add("heartbeat of the motor", 1, When::EveryMs(u32::from(motor.heartbeat_ms)));
        }
        MotorSettings::Cansimple(motor) => {
            budget.add("heartbeat of the motor", 8, When::EveryMs(u32::from(motor.heartbeat_ms)));
            budget.add("position of the motor", 8, When::EveryMs(u32::from(motor.encoder_ms)));
        }
        MotorSettings::Mit(_) => budget.add("reply of the motor", 8, When::EachPeriod),
    }
    for sensor in &file.sensors {
        let name = format!("heartbeat of node {}", sensor.node);
        budget.add(name, 1, When::EveryMs(u32::from(sensor.heartbeat_ms)));
    }
    budget
}
