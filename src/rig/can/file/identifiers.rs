//! Who uses which identifier of the bus. Two that use one destroy each other's frames, or one is taken for the other: a
//! measurement for a command, a reply for SYNC.

use super::motors::MotorSettings;
use super::rig_file::CanRigFile;
use crate::rig::can::canopen::{OwnCommands, cob};
use crate::rig::can::cansimple::COMMANDS_TO_AXIS;

impl CanRigFile {
    /// What only this program may send on the bus of the rig.
    pub fn own_commands(&self) -> OwnCommands {
        let mut ids = vec![cob::HEARTBEAT + u16::from(self.master.node)];
        let mut nodes: Vec<u8> = self.sensors.iter().map(|sensor| sensor.node).collect();
        match &self.motor {
            MotorSettings::Cia402(motor) => {
                ids.push(motor_target(motor.node));
                nodes.push(motor.node);
            }
            MotorSettings::Cansimple(motor) => {
                ids.extend(COMMANDS_TO_AXIS.iter().map(|command| u16::from(motor.node) << 5 | command));
            }
            MotorSettings::Mit(motor) => ids.push(motor.id),
        }
        OwnCommands::new(ids, nodes)
    }
}

/// The target of a CiA 402 motor (RPDO 1).
fn motor_target(node: u8) -> u16 {
    0x200 + u16::from(node)
}

/// An identifier, or a block of them, and who uses it.
struct Use {
    ids: std::ops::RangeInclusive<u16>,
    who: String,
    path: String,
}

/// Every use of an identifier or node id that is another's already: the field, and what it must be.
pub(super) fn collisions(file: &CanRigFile) -> Vec<(String, String)> {
    let mut found = double_nodes(file);
    found.extend(double_tpdos(file));
    let uses = uses(file);
    for (at, one) in uses.iter().enumerate() {
        let taken = reserved(file, &one.ids).or_else(|| {
            let earlier = uses[..at].iter().find(|other| overlap(&one.ids, &other.ids))?;
            let id = (*one.ids.start()).max(*earlier.ids.start());
            Some((id, earlier.who.clone()))
        });
        if let Some((id, owner)) = taken {
            let expected =
                format!("identifiers of its own for {}; {id:03X}h is used by {owner} already", one.who);
            found.push((one.path.clone(), expected));
        }
    }
    found
}

/// Everything that this rig sends, but for what CANopen reserves.
fn uses(file: &CanRigFile) -> Vec<Use> {
    let one =
        |id: u16, who: &str, path: &str| Use { ids: id..=id, who: who.to_owned(), path: path.to_owned() };
    let mut uses = match &file.motor {
        MotorSettings::Cia402(motor) => {
            vec![one(motor_target(motor.node), "the target of the motor (RPDO 1)", "motor.node")]
        }
        MotorSettings::Cansimple(motor) => {
            let first = u16::from(motor.node) << 5;
            vec![Use {
                ids: first..=first + 0x1F,
                who: format!("the motor (CANSimple, node {}, uses 32 identifiers)", motor.node),
                path: "motor.node".to_owned(),
            }]
        }
        MotorSettings::Mit(motor) => vec![
            one(motor.id, "commands to the motor", "motor.id"),
            one(motor.reply_id, "replies of the motor", "motor.reply_id"),
        ],
    };
    for (at, frame) in file.frames.iter().enumerate() {
        if let Some(id) = frame.identifier() {
            uses.push(one(id, &format!("frame {at}"), &format!("frames[{at}]")));
        }
    }
    uses
}

/// The first of the identifiers that CANopen reserves, and for what.
fn reserved(file: &CanRigFile, ids: &std::ops::RangeInclusive<u16>) -> Option<(u16, String)> {
    // A motor in MIT mode replies with identifier 0 as delivered; only CANopen nodes take that for a command.
    let is_minded = !file.sensors.is_empty() || matches!(file.motor, MotorSettings::Cia402(_));
    let nmt = is_minded.then_some((cob::NMT..=cob::NMT, "NMT commands"));
    let others = [
        (cob::SYNC..=cob::SYNC, "SYNC"),
        (cob::EMERGENCY + 1..=cob::EMERGENCY + 0x7F, "emergencies of CANopen nodes"),
        (cob::SDO_ANSWER..=cob::SDO_REQUEST + 0x7F, "SDOs of CANopen nodes"),
        (cob::HEARTBEAT..=0x7FF, "heartbeats and network management of CANopen"),
    ];
    nmt.into_iter().chain(others).find(|(range, _)| overlap(range, ids)).map(|(range, who)| {
        (
            (*range.start()).max(*ids.start()),
            format!("{who} ({:03X}h to {:03X}h)", range.start(), range.end()),
        )
    })
}

fn overlap(one: &std::ops::RangeInclusive<u16>, other: &std::ops::RangeInclusive<u16>) -> bool {
    one.start() <= other.end() && other.start() <= one.end()
}

/// Node ids of CANopen: this program, the motor, the sensors.
fn double_nodes(file: &CanRigFile) -> Vec<(String, String)> {
    let mut nodes = vec![(file.master.node, "this program".to_owned(), "master.node".to_owned())];
    if let MotorSettings::Cia402(motor) = &file.motor {
        nodes.push((motor.node, "the motor".to_owned(), "motor.node".to_owned()));
    }
    for (at, sensor) in file.sensors.iter().enumerate() {
        nodes.push((sensor.node, format!("sensor {at}"), format!("sensors[{at}].node")));
    }
    let doubles = nodes.iter().enumerate().filter_map(|(at, (node, _, path))| {
        let (_, owner, _) = nodes[..at].iter().find(|(other, ..)| other == node)?;
        Some((path.clone(), format!("a node id of its own; {node} is that of {owner}")))
    });
    doubles.collect()
}

/// A TPDO is one frame, whatever its identifier.
fn double_tpdos(file: &CanRigFile) -> Vec<(String, String)> {
    let doubles = file.frames.iter().enumerate().filter_map(|(at, frame)| {
        let own = (frame.node?, frame.tpdo?);
        let earlier = file.frames[..at]
            .iter()
            .position(|other| (other.node, other.tpdo) == (Some(own.0), Some(own.1)))?;
        let expected =
            format!("a TPDO of its own; TPDO {} of node {} is frame {earlier} already", own.1, own.0);
        Some((format!("frames[{at}].tpdo"), expected))
    });
    doubles.collect()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::rig::can::file::ValidRigFile;

    const PLAIN: &str = include_str!("../../../../fixtures/can/rigs/plain.json");
    const TRANSDUCER: &str = include_str!("../../../../fixtures/can/rigs/transducer.json");
    const MIT: &str = include_str!("../../../../fixtures/can/rigs/mit.json");
    const ODRIVE: &str = include_str!("../../../../fixtures/can/rigs/odrive.json");

    fn refusal(text: &str, change: &dyn Fn(&mut Value)) -> Option<String> {
        let mut rig: Value = serde_json::from_str(text).unwrap();
        change(&mut rig);
        ValidRigFile::parse(&format!("{rig:#}"), "rig.json").err().map(|error| error.to_string())
    }

    #[test]
    fn an_identifier_that_another_uses_is_refused_at_its_own_field() {
        type Change = &'static dyn Fn(&mut Value);
        let cases: [(&str, &str, Change); 18] = [
            ("motor.node", PLAIN, &|rig| rig["motor"]["node"] = json!(1)),
            ("sensors[0].node", TRANSDUCER, &|rig| rig["sensors"][0]["node"] = json!(5)),
            ("sensors[0].node", TRANSDUCER, &|rig| rig["sensors"][0]["node"] = json!(1)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x185)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x205)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x080)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x085)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x000)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x585)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x67F)),
            ("frames[1] is", PLAIN, &|rig| rig["frames"][1]["id"] = json!(0x701)),
            ("frames[1].tpdo", PLAIN, &|rig| {
                rig["frames"][1]["tpdo"] = json!(1);
                rig["frames"][1]["id"] = json!(0x2A0);
            }),
            ("motor.reply_id", MIT, &|rig| rig["motor"]["reply_id"] = json!(1)),
            ("motor.reply_id", MIT, &|rig| rig["motor"]["reply_id"] = json!(0x80)),
            ("motor.reply_id", MIT, &|rig| rig["motor"]["reply_id"] = json!(0)),
            ("motor.id", MIT, &|rig| rig["motor"]["id"] = json!(0x701)),
            ("frames[0] is", MIT, &|rig| rig["motor"]["reply_id"] = json!(0x1A0)),
            ("motor.node", ODRIVE, &|rig| rig["motor"]["node"] = json!(4)),
        ];
        for (at, (place, text, change)) in cases.into_iter().enumerate() {
            let refused = refusal(text, change).unwrap_or_else(|| panic!("case {at}, {place}: accepted"));
            assert!(refused.contains(&format!(": {place}")), "case {at}, {place}: {refused}");
        }
    }

    #[test]
    fn the_rigs_of_the_repository_collide_with_nobody() {
        for text in [PLAIN, TRANSDUCER, MIT, ODRIVE] {
            assert_eq!(refusal(text, &|_| {}), None);
        }
    }
}
