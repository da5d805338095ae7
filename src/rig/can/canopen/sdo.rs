//! The SDO client: expedited writes, expedited and segmented reads.
//!
//! A read that is not answered is asked again; a write is not, for the server may have carried it out. What it did is
//! seen by reading back.

use std::time::Duration;

use super::cob;
use super::error::CanopenError;
use super::link::Link;
use super::object::{Object, Value};
use crate::rig::can::bus::Frame;

/// How long a server may take for an answer.
const SDO_TIMEOUT: Duration = Duration::from_millis(300);
/// How often a read is asked.
const SDO_ATTEMPTS: usize = 3;
/// More than any object of a drive that is read here.
const MAX_OBJECT_BYTES: usize = 4096;

const ABORT: u8 = 0x80;
const TIMED_OUT: u32 = 0x0504_0000;
const TOGGLE: u32 = 0x0503_0000;
const UNKNOWN_COMMAND: u32 = 0x0504_0001;
const OUT_OF_MEMORY: u32 = 0x0504_0005;

impl Link {
    /// Reads up to four bytes.
    ///
    /// # Errors
    /// Silence or an abort.
    pub fn read(&mut self, node: u8, object: Object) -> Result<Value, CanopenError> {
        let data = self.read_bytes(node, object)?;
        let too_long =
            CanopenError::SdoAborted { node, index: object.index, sub: object.sub, code: 0x0607_0012 };
        Value::from_bytes(&data).ok_or(too_long)
    }

    /// Reads an object of any length.
    ///
    /// # Errors
    /// Silence or an abort.
    pub fn read_bytes(&mut self, node: u8, object: Object) -> Result<Vec<u8>, CanopenError> {
        let mut attempt = 1;
        loop {
            match self.upload(node, object) {
                Err(CanopenError::SdoSilent { .. }) if attempt < SDO_ATTEMPTS => attempt += 1,
                outcome => return outcome,
            }
        }
    }

    /// Writes up to four bytes.
    ///
    /// # Errors
    /// Silence or an abort.
    pub fn write(&mut self, node: u8, object: Object, value: impl Into<Value>) -> Result<(), CanopenError> {
        let value = value.into();
        let bytes = value.bytes();
        let mut request = request(0x23 | (4 - bytes.len() as u8) << 2, object);
        request[4..4 + bytes.len()].copy_from_slice(bytes);
        let answer = self.ask(node, object, &request)?;
        if answer[0] != 0x60 || answer[1..4] != request[1..4] {
            return Err(self.abort(node, object, UNKNOWN_COMMAND));
        }
        Ok(())
    }

    /// Writes, reads back, and compares.
    ///
    /// # Errors
    /// Silence, an abort, or [`CanopenError::ValueNotAccepted`].
    pub fn write_and_confirm(
        &mut self,
        node: u8,
        object: Object,
        value: impl Into<Value>,
    ) -> Result<(), CanopenError> {
        let value = value.into();
        self.write(node, object, value)?;
        let read = self.read(node, object)?;
        // Some servers do not tell the length of what they read.
        if read.bytes().starts_with(value.bytes()) {
            return Ok(());
        }
        let (written, read) = (value.number(), read.number());
        Err(CanopenError::ValueNotAccepted { node, index: object.index, sub: object.sub, written, read })
    }

    fn upload(&mut self, node: u8, object: Object) -> Result<Vec<u8>, CanopenError> {
        let first = request(0x40, object);
        let answer = self.ask(node, object, &first)?;
        if answer[0] & 0xE0 != 0x40 || answer[1..4] != first[1..4] {
            return Err(self.abort(node, object, UNKNOWN_COMMAND));
        }
        let (expedited, sized) = (answer[0] & 2 != 0, answer[0] & 1 != 0);
        if expedited {
            let unused = if sized { usize::from(answer[0] >> 2 & 3) } else { 0 };
            return Ok(answer[4..8 - unused].to_vec());
        }
        let mut data = Vec::new();
        let mut toggle = 0u8;
        loop {
            let mut segment = [0u8; 8];
            segment[0] = 0x60 | toggle << 4;
            let answer = self.ask(node, object, &segment)?;
            if answer[0] & 0xF0 != toggle << 4 {
                return Err(self.abort(node, object, TOGGLE));
            }
            let unused = usize::from(answer[0] >> 1 & 7);
            data.extend_from_slice(&answer[1..8 - unused]);
            if answer[0] & 1 != 0 {
                return Ok(data);
            }
            if data.len() > MAX_OBJECT_BYTES {
                return Err(self.abort(node, object, OUT_OF_MEMORY));
            }
            toggle ^= 1;
        }
    }

    /// A request and its answer. Other frames that arrive meanwhile are counted and dropped.
    fn ask(&mut self, node: u8, object: Object, request: &[u8; 8]) -> Result<[u8; 8], CanopenError> {
        self.send(&Frame::new(cob::SDO_REQUEST + u16::from(node), request))?;
        let deadline = self.now() + SDO_TIMEOUT.mul_f64(self.time_stretch());
        let id = cob::SDO_ANSWER + u16::from(node);
        while let Some(frame) = self.receive(deadline)? {
            if frame.id != id {
                // Others that fill the bus do not hold the question up.
                if self.now() >= deadline {
                    break;
                }
                continue;
            }
            let Ok(answer) = <[u8; 8]>::try_from(frame.data()) else { continue };
            if answer[0] != ABORT {
                return Ok(answer);
            }
            let about = (u16::from_le_bytes([answer[1], answer[2]]), answer[3]);
            if about == (object.index, object.sub) {
                let code = u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]]);
                return Err(CanopenError::SdoAborted { node, index: object.index, sub: object.sub, code });
            }
        }
        // The server is told, so that a late answer is not taken for that to the next question.
        self.abort(node, object, TIMED_OUT);
        Err(CanopenError::no_answer(node, object))
    }

    fn abort(&mut self, node: u8, object: Object, code: u32) -> CanopenError {
        let mut frame = request(ABORT, object);
        frame[4..].copy_from_slice(&code.to_le_bytes());
        match self.send(&Frame::new(cob::SDO_REQUEST + u16::from(node), &frame)) {
            Ok(()) => CanopenError::SdoAborted { node, index: object.index, sub: object.sub, code },
            Err(fault) => fault,
        }
    }
}

fn request(command: u8, object: Object) -> [u8; 8] {
    let [low, high] = object.index.to_le_bytes();
    [command, low, high, object.sub, 0, 0, 0, 0]
}
