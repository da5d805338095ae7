//! The rig file: what is on the bus, what its numbers mean, and what may never be exceeded. Checked at the door.

mod error;
mod rules;
mod types;

pub use error::RigFileError;
pub use types::*;

use std::fs;
use std::path::Path;

use crate::protocol::Problem;
use crate::protocol::source::Node;

use super::budget::{Budget, When};
use super::units::{BusPeriod, SamplePeriod};

/// A rig file that passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidRigFile {
    file: RigFile,
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
    pub fn read(path: &Path) -> Result<Self, RigFileError> {
        let file = path.display().to_string();
        let text = fs::read_to_string(path)
            .map_err(|source| RigFileError::Unreadable { file: file.clone(), source })?;
        Self::parse(&text, &file)
    }

    /// Reads a rig from its JSON `text`; `name` is that of the file, for messages.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn parse(text: &str, name: &str) -> Result<Self, RigFileError> {
        let source = Node::parse(text, name).map_err(RigFileError::NotJson)?;
        let invalid = |problems| RigFileError::Invalid { file: name.to_owned(), problems };
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
    type Target = RigFile;

    fn deref(&self) -> &RigFile {
        &self.file
    }
}

fn typed(source: &Node) -> Result<RigFile, Problem> {
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

impl RigFile {
    /// Bytes of something carried.
    pub fn bytes(&self, carried: Carried) -> usize {
        let signals = &self.signals;
        match carried {
            Carried::Statusword => 2,
            Carried::Position => 4,
            Carried::Torque => signals.torque.kind.bytes() * signals.torque.samples,
            Carried::PositionSteps => {
                signals.position_steps.map_or(0, |steps| steps.kind.bytes() * steps.samples)
            }
            Carried::Counter => signals.counter.map_or(0, |counter| counter.kind.bytes()),
            Carried::EmgFcr => signals.emg_fcr.map_or(0, |emg| emg.kind.bytes()),
            Carried::EmgEcr => signals.emg_ecr.map_or(0, |emg| emg.kind.bytes()),
        }
    }

    /// Bytes of a frame.
    pub fn frame_bytes(&self, frame: &FrameLayout) -> usize {
        frame.carries.iter().map(|carried| self.bytes(*carried)).sum()
    }

    /// Bytes of the frame with the target.
    pub fn target_bytes(&self) -> usize {
        match self.motor {
            Motor::Cia402(_) => 6 + self.display.map_or(0, |display| display.kind.bytes()),
            Motor::Cansimple(_) | Motor::Mit(_) => 8,
        }
    }
}

impl FrameLayout {
    /// Its identifier: the one given, or that of the pre-defined connection set.
    pub fn identifier(&self) -> Option<u16> {
        self.id.or_else(|| {
            let (node, number) = (u16::from(self.node?), u16::from(self.tpdo?));
            (1..=4).contains(&number).then(|| 0x180 + 0x100 * (number - 1) + node)
        })
    }
}

fn budget(file: &RigFile) -> Budget {
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
        Motor::Cia402(motor) => {
            budget.add("heartbeat of the motor", 1, When::EveryMs(u32::from(motor.heartbeat_ms)));
        }
        Motor::Cansimple(motor) => {
            budget.add("heartbeat of the motor", 8, When::EveryMs(u32::from(motor.heartbeat_ms)));
            budget.add("position of the motor", 8, When::EveryMs(u32::from(motor.encoder_ms)));
        }
        Motor::Mit(_) => budget.add("reply of the motor", 8, When::EachPeriod),
    }
    for sensor in &file.sensors {
        let name = format!("heartbeat of node {}", sensor.node);
        budget.add(name, 1, When::EveryMs(u32::from(sensor.heartbeat_ms)));
    }
    budget
}
