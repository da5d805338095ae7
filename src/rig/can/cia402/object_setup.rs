//! Reads and writes the objects of a drive one after the other. What is missing or refused is noted and the rest goes on, so
//! that the operator sees everything at once.

use crate::rig::can::canopen::{CanopenError, Link, Object, Value};
use crate::rig::can::cia402_objects::{Need, object_use};
use crate::rig::can::fault::CanFault;
use crate::rig::can::finding::{ObjectFinding, ObjectProblem};

/// Abort code: attempt to write a read-only object (CiA 301).
const READ_ONLY: u32 = 0x0601_0002;

/// Abort codes that say that there is no such object.
const MISSING: [u32; 2] = [0x0602_0000, 0x0609_0011];

/// The objects of one drive while it is set up.
pub(super) struct ObjectSetup<'a> {
    pub link: &'a mut Link,
    pub node: u8,
    findings: Vec<ObjectFinding>,
}

impl<'a> ObjectSetup<'a> {
    pub fn new(link: &'a mut Link, node: u8) -> Self {
        Self { link, node, findings: Vec::new() }
    }

    /// Everything that was missing or refused.
    pub fn into_findings(self) -> Vec<ObjectFinding> {
        self.findings
    }

    /// The first finding with which the motor may not be armed.
    pub fn first_fault(&self) -> Result<(), CanFault> {
        match self.findings.iter().find_map(ObjectFinding::fault) {
            Some(fault) => Err(fault),
            None => Ok(()),
        }
    }

    /// Writes an object and reads it back. `is_needed` decides where the table of objects leaves it to the rig.
    ///
    /// # Errors
    /// The drive does not answer. What it refuses is noted.
    pub fn write(
        &mut self,
        object: Object,
        value: impl Into<Value>,
        is_needed: bool,
    ) -> Result<(), CanopenError> {
        let value = value.into();
        let Err(error) = self.link.write_and_confirm(self.node, object, value) else { return Ok(()) };
        if is_missing(&error) {
            self.note(object, ObjectProblem::Missing { is_needed: needed(object, is_needed) });
            return Ok(());
        }
        match error {
            // An object that cannot be written may hold what is wanted. A drive that refuses a value is not asked further.
            CanopenError::SdoAborted { code, .. } => {
                let holds = code == READ_ONLY
                    && matches!(self.link.read(self.node, object), Ok(read) if read.bytes().starts_with(value.bytes()));
                if !holds {
                    self.note(object, ObjectProblem::Refused(error));
                }
                Ok(())
            }
            CanopenError::ValueNotAccepted { .. } => {
                self.note(object, ObjectProblem::Refused(error));
                Ok(())
            }
            other => Err(other),
        }
    }

    /// Reads an object; `None` if the drive does not have it, which is noted.
    ///
    /// # Errors
    /// The drive does not answer. What it refuses is noted.
    pub fn read(&mut self, object: Object) -> Result<Option<u32>, CanopenError> {
        self.read_needed(object, true)
    }

    /// [`Self::read`], where the table of objects leaves it to the rig whether the drive must have the object: `is_needed` decides.
    ///
    /// # Errors
    /// The drive does not answer. What it refuses is noted.
    pub fn read_needed(&mut self, object: Object, is_needed: bool) -> Result<Option<u32>, CanopenError> {
        match self.link.read(self.node, object) {
            Ok(value) => Ok(Some(value.number())),
            Err(error) if is_missing(&error) => {
                self.note(object, ObjectProblem::Missing { is_needed: needed(object, is_needed) });
                Ok(None)
            }
            Err(error @ CanopenError::SdoAborted { .. }) => {
                self.note(object, ObjectProblem::Refused(error));
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Notes that a unit is not that of the rig file.
    pub fn wrong_unit(&mut self, object: Object, read: u32, expected: u32) {
        self.note(object, ObjectProblem::Unit { read, expected });
    }

    /// Notes that the drive says it is another device than that of the rig file.
    pub fn wrong_device(&mut self, object: Object, read: u32, expected: u32) {
        let (node, index, sub) = (self.node, object.index, object.sub);
        self.note(
            object,
            ObjectProblem::Refused(CanopenError::WrongDevice { node, index, sub, read, expected }),
        );
    }

    /// Notes what came of a longer dialogue about an object.
    ///
    /// # Errors
    /// The drive does not answer.
    pub fn note_refusal(&mut self, outcome: Result<(), CanopenError>) -> Result<(), CanopenError> {
        match outcome {
            Err(
                error @ (CanopenError::SdoAborted { index, sub, .. }
                | CanopenError::ValueNotAccepted { index, sub, .. }),
            ) => {
                self.note(Object::entry(index, sub), ObjectProblem::Refused(error));
                Ok(())
            }
            other => other,
        }
    }

    fn note(&mut self, object: Object, problem: ObjectProblem) {
        self.findings.push(ObjectFinding { node: self.node, object, problem });
    }
}

/// Whether an error says that the drive has no such object.
pub(super) fn is_missing(error: &CanopenError) -> bool {
    matches!(error, CanopenError::SdoAborted { code, .. } if MISSING.contains(code))
}

fn needed(object: Object, by_rig: bool) -> bool {
    match object_use(object).map(|row| row.need) {
        Some(Need::Optional) => false,
        Some(Need::ByRig(_)) => by_rig,
        Some(Need::Needed) | None => true,
    }
}
