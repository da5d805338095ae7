//! What every CANopen device of a rig is asked and told: who it is, and which TPDOs it sends.

use super::canopen::pdo::{MAX_PDOS, Pdo, PdoDirection};
use super::canopen::{CanopenError, Link, Object};
use super::file::{CanRigFile, Carried, FrameLayout, Identity};

/// Whether the device is the one that the rig file means.
pub fn identify(link: &mut Link, node: u8, identity: &Identity) -> Result<(), CanopenError> {
    for (sub, expected) in [(1, identity.vendor), (2, identity.product)] {
        expect(link, node, Object::entry(0x1018, sub), expected)?;
    }
    Ok(())
}

/// Whether an object reads what it must.
pub fn expect(link: &mut Link, node: u8, object: Object, expected: u32) -> Result<(), CanopenError> {
    let read = link.read(node, object)?.number();
    if read == expected {
        return Ok(());
    }
    Err(CanopenError::WrongDevice { node, index: object.index, sub: object.sub, read, expected })
}

/// The TPDOs of a node as the rig file has them; the others are switched off.
pub fn write_tpdos(link: &mut Link, node: u8, file: &CanRigFile) -> Result<(), CanopenError> {
    let own = |frame: &&FrameLayout| frame.node == Some(node);
    for number in 1..=MAX_PDOS {
        match file.frames.iter().filter(own).find(|frame| frame.tpdo == Some(number)) {
            None => link.switch_off_pdo(node, PdoDirection::Transmit, number)?,
            Some(frame) => {
                let pdo = Pdo {
                    direction: PdoDirection::Transmit,
                    number,
                    id: frame.identifier().unwrap_or(0),
                    mapped: frame.carries.iter().filter_map(|carried| mapped(file, *carried)).collect(),
                    deadline_ms: 0,
                };
                link.configure_pdo(node, &pdo)?;
            }
        }
    }
    Ok(())
}

fn mapped(file: &CanRigFile, carried: Carried) -> Option<(Object, usize)> {
    let signals = &file.signals;
    let object = match carried {
        Carried::Statusword => Some(Object::plain(0x6041)),
        Carried::Position => Some(Object::plain(0x6064)),
        Carried::PositionSteps => signals.position_steps.and_then(|steps| steps.object),
        Carried::Torque => signals.torque.object,
        Carried::Counter => signals.counter.and_then(|counter| counter.object),
        Carried::EmgFcr => signals.emg_fcr.and_then(|emg| emg.object),
        Carried::EmgEcr => signals.emg_ecr.and_then(|emg| emg.object),
    };
    object.map(|object| (object, file.bytes(carried)))
}
