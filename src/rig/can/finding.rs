//! What was found about an object while a device was set up: it is missing, or refuses what it is to hold.

use std::fmt;

use super::canopen::{CanopenError, Object};
use super::cia402_objects::object_use;
use super::fault::CanFault;

/// An object that is missing or refuses its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectFinding {
    /// The node.
    pub node: u8,
    /// The object.
    pub object: Object,
    /// What is wrong.
    pub problem: ObjectProblem,
}

/// What is wrong with an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObjectProblem {
    /// The device does not have it.
    Missing {
        /// Whether the motor may not be armed without it.
        is_needed: bool,
    },
    /// The device refuses the value, or holds another one.
    Refused(CanopenError),
    /// It scales other objects otherwise than the rig file says.
    Unit {
        /// What it reads.
        read: u32,
        /// What the rig file counts on.
        expected: u32,
    },
}

impl ObjectFinding {
    /// Why the motor may not be armed with it; `None` for an object that may be missing.
    pub fn fault(&self) -> Option<CanFault> {
        let (node, Object { index, sub }) = (self.node, self.object);
        match self.problem {
            ObjectProblem::Missing { is_needed: false } => None,
            ObjectProblem::Missing { is_needed: true } => Some(CanFault::ObjectMissing { node, index, sub }),
            ObjectProblem::Refused(error) => Some(error.into()),
            ObjectProblem::Unit { read, expected } => {
                Some(CanFault::WrongUnit { node, index, sub, read, expected })
            }
        }
    }
}

/// One line for the operator: what is wrong, what follows, what to do.
impl fmt::Display for ObjectFinding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (meaning, without, remedy) = object_use(self.object)
            .map_or(("object", "it is needed", "see its manual"), |row| {
                (row.meaning, row.without, row.remedy)
            });
        match self.fault() {
            None => write!(formatter, "{} ({meaning}) is not there, and is optional: {without}", self.object),
            Some(CanFault::ObjectMissing { .. }) => {
                write!(
                    formatter,
                    "{} ({meaning}) is not there, and is needed: {without}; {remedy}",
                    self.object
                )
            }
            Some(CanFault::WrongUnit { .. }) => {
                self.fault().map_or(Ok(()), |fault| write!(formatter, "{fault}"))
            }
            Some(fault) => write!(formatter, "{} ({meaning}): {fault}; in the drive: {remedy}", self.object),
        }
    }
}
