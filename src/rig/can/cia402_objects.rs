//! The objects of a CiA 402 drive that the program reads or writes: what each is for, whether it is needed, and what happens
//! without it. `ramphold rig check` and docs/reference/cia402-objects.md show this table.

use super::canopen::Object;

/// Whether a drive must have an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// Without it the motor is not armed.
    Needed,
    /// Without it the motor is armed, with the consequence that the table tells.
    Optional,
    /// Needed for some rig files; for which, the text says.
    ByRig(&'static str),
}

/// An object, or the entries of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ObjectUse {
    /// Index.
    pub index: u16,
    /// Sub-indices, as people write them.
    pub entries: &'static str,
    /// What it is for.
    pub meaning: &'static str,
    /// Whether it is needed.
    pub need: Need,
    /// What happens without it; of a needed object, why it is needed.
    pub without: &'static str,
    /// What to set in the drive when it refuses, or reads another value than expected.
    pub remedy: &'static str,
}

const fn row(
    index: u16,
    entries: &'static str,
    need: Need,
    [meaning, without, remedy]: [&'static str; 3],
) -> ObjectUse {
    ObjectUse { index, entries, meaning, need, without, remedy }
}

use Need::{ByRig, Needed, Optional};

const MAPPING: &str = "allow PDO mapping to be changed in PRE-OPERATIONAL, or use a firmware that does";
const IDENTITY: &str = "correct motor.identity after making sure which drive this is";

/// Every object, by index.
pub const OBJECTS: &[ObjectUse] = &[
    row(
        0x1016,
        "01",
        Needed,
        [
            "heartbeat of this program, which the drive watches",
            "a drive whose program died would go on moving",
            "free entry 01 of 1016h",
        ],
    ),
    row(
        0x1017,
        "00",
        Needed,
        [
            "interval of the drive's heartbeat",
            "the program would not notice a drive that restarted or left OPERATIONAL",
            "choose a heartbeat_ms that the drive takes",
        ],
    ),
    row(
        0x1018,
        "01, 02",
        Needed,
        ["vendor and product", "another drive could be taken for this one", IDENTITY],
    ),
    row(
        0x1029,
        "01",
        Optional,
        [
            "NMT state after a lost heartbeat: PRE-OPERATIONAL",
            "CiA 301 prescribes PRE-OPERATIONAL for a drive without it, which is what would be written",
            "set 1029h:01 to 0",
        ],
    ),
    row(
        0x1400,
        "01, 02",
        Needed,
        ["identifier and type of the frame with the target", "the motor gets no target", MAPPING],
    ),
    row(
        0x1400,
        "05",
        ByRig("target_wait_ms is not 0"),
        [
            "time without a target after which the drive faults",
            "only the heartbeat stops a motor whose program died",
            "set target_wait_ms to 0 if the drive has no event timer of RPDOs",
        ],
    ),
    row(
        0x1600,
        "00 to 03",
        Needed,
        ["what the frame with the target carries", "the motor gets no target", MAPPING],
    ),
    row(
        0x1800,
        "01, 02",
        Needed,
        ["identifiers and types of the measured frames", "the program sees nothing", MAPPING],
    ),
    row(0x1A00, "00 to 08", Needed, ["what the measured frames carry", "the program sees nothing", MAPPING]),
    row(
        0x6007,
        "00",
        Needed,
        [
            "reaction to a lost heartbeat: fault",
            "what the motor does after the program died would be left to the manufacturer",
            "set 6007h to 1 (fault)",
        ],
    ),
    row(0x603F, "00", Optional, ["error code", "messages tell no error code", "nothing"]),
    row(
        0x6040,
        "00",
        Needed,
        ["controlword", "the drive cannot be commanded", "nothing: CiA 402 demands it"],
    ),
    row(
        0x6041,
        "00",
        Needed,
        ["statusword", "the drive's state is not known", "nothing: CiA 402 demands it"],
    ),
    row(
        0x605A,
        "00",
        Optional,
        [
            "reaction to a quick stop: the ramp 6085h, then no power",
            "CiA 402 prescribes this reaction as the default; make sure in the manual that the drive has it",
            "set 605Ah to 2",
        ],
    ),
    row(
        0x605E,
        "00",
        Optional,
        [
            "reaction to a fault: the ramp 6085h, then no power",
            "CiA 402 prescribes this reaction as the default; make sure in the manual that the drive has it",
            "set 605Eh to 2",
        ],
    ),
    row(
        0x6060,
        "00",
        Needed,
        ["mode of operation", "neither homing nor motion can be chosen", "nothing: CiA 402 demands it"],
    ),
    row(
        0x6061,
        "00",
        Needed,
        [
            "mode of operation that is active",
            "a target could reach a drive in another mode",
            "nothing: CiA 402 demands it",
        ],
    ),
    row(0x6064, "00", Needed, ["position", "the angle is not known", "nothing: CiA 402 demands it"]),
    row(
        0x6065,
        "00",
        Optional,
        [
            "following error that is allowed",
            "only the program compares target and angle",
            "open the range of 6065h, or correct limits.following_error_rad",
        ],
    ),
    row(
        0x6066,
        "00",
        Optional,
        [
            "time for which a following error is allowed",
            "the drive faults after a time of its own; only the program keeps limits.following_error_ms",
            "open the range of 6066h, or correct limits.following_error_ms",
        ],
    ),
    row(
        0x6071,
        "00",
        Optional,
        [
            "target torque, which positions have no use for: 1 since the drive was armed, 2 while its home is found, 0 after a restart or an error of its encoder",
            "a drive that keeps its settings shows only by its boot-up message that it was restarted",
            "nothing",
        ],
    ),
    row(
        0x6072,
        "00",
        Needed,
        [
            "highest torque of the motor",
            "the limb would have no guard against the motor's full torque but the program",
            "open the range of 6072h, or correct limits.motor_torque_nm and motor.rated_torque_nm",
        ],
    ),
    row(
        0x6076,
        "00",
        Needed,
        [
            "rated torque, the unit of 6072h",
            "the guard against torque would have an unknown scale",
            "set the motor's rated torque in the drive, or correct motor.rated_torque_nm",
        ],
    ),
    row(0x607A, "00", Needed, ["target position", "the motor gets no target", "nothing: CiA 402 demands it"]),
    row(
        0x607C,
        "00",
        Optional,
        [
            "home offset: 0, for drives do not agree on its sign; the program counts homing.offset_rad itself",
            "home is at 0, which is what would be written",
            "set 607Ch to 0 in the drive",
        ],
    ),
    row(
        0x607D,
        "01, 02",
        Needed,
        [
            "lowest and highest target position",
            "the limb would have no guard against a wrong angle but the program",
            "open the range of 607Dh, or correct limits.angle_rad",
        ],
    ),
    row(
        0x607E,
        "00",
        Optional,
        [
            "direction of rotation, which must not be reversed",
            "taken as not reversed",
            "set 607Eh to 0, and give the direction by the sign of motor.gear_ratio",
        ],
    ),
    row(
        0x6080,
        "00",
        Optional,
        [
            "highest speed of the motor",
            "only the program limits the speed",
            "open the range of 6080h, or correct limits.speed_rad_s",
        ],
    ),
    row(
        0x6085,
        "00",
        Needed,
        [
            "deceleration of a quick stop",
            "how far the handle goes after a fault would not be known",
            "open the range of 6085h, or correct motor.quick_stop_rad_s2",
        ],
    ),
    row(
        0x608F,
        "01, 02",
        ByRig("motor.counts_checked_by_hand is not true"),
        [
            "encoder counts in a turn of the motor",
            "with wrong counts every angle and speed is wrong by the same factor, and no motion shows it",
            "correct motor.counts_per_revolution, or set the encoder's resolution in the drive; for a drive without 608Fh turn the handle \
             by a known angle, compare 6064h, and set motor.counts_checked_by_hand to true",
        ],
    ),
    row(
        0x6091,
        "01, 02",
        Optional,
        [
            "gear ratio of the drive, which must be 1",
            "taken as 1",
            "set 6091h:01 and 6091h:02 to 1, and give the gear by motor.gear_ratio",
        ],
    ),
    row(
        0x6092,
        "01, 02",
        Optional,
        [
            "units of 6064h in a turn of the shaft",
            "taken as encoder counts",
            "set 6092h:01 to motor.counts_per_revolution and 6092h:02 to 1",
        ],
    ),
    row(
        0x6098,
        "00",
        Needed,
        [
            "method of homing",
            "the drive cannot find the start position",
            "choose a homing.method that the drive has",
        ],
    ),
    row(
        0x6099,
        "01, 02",
        ByRig("homing.method is neither 35 nor 37"),
        [
            "speeds of homing",
            "methods 35 and 37 do not move the motor",
            "open the range of 6099h, or correct the speeds of motor.homing",
        ],
    ),
    row(
        0x609A,
        "00",
        Optional,
        [
            "acceleration of homing",
            "the drive homes with an acceleration of its own; its speed is supervised",
            "open the range of 609Ah, or correct motor.homing.acceleration_rad_s2",
        ],
    ),
    row(
        0x60A8,
        "00",
        Optional,
        [
            "unit of positions: increments",
            "taken as increments",
            "set 60A8h to 00B50000h (increments) or to 0",
        ],
    ),
    row(
        0x60A9,
        "00",
        Optional,
        [
            "unit of speeds: increments/s",
            "taken as increments/s; the speed of homing is supervised",
            "set 60A9h to 00B50300h (increments/s) or to 0",
        ],
    ),
    row(
        0x60AA,
        "00",
        Optional,
        [
            "unit of accelerations: increments/s2",
            "taken as increments/s2: make sure in the manual, for 6085h depends on it",
            "set the numerator of 60AAh to B5h (increments) without a power of ten, or 60AAh to 0",
        ],
    ),
    row(
        0x60B0,
        "00",
        Optional,
        [
            "position that the drive adds to its target: 0",
            "taken as 0",
            "set 60B0h to 0, and take it out of every receive PDO",
        ],
    ),
    row(
        0x60B1,
        "00",
        Optional,
        [
            "speed that the drive adds to that of its target: 0",
            "taken as 0",
            "set 60B1h to 0, and take it out of every receive PDO",
        ],
    ),
    row(
        0x60B2,
        "00",
        Optional,
        [
            "torque that the drive adds to that of its control loop: 0",
            "taken as 0",
            "set 60B2h to 0, and take it out of every receive PDO",
        ],
    ),
    row(
        0x60C2,
        "01",
        Needed,
        [
            "period of the targets",
            "the drive would step from target to target",
            "choose a period_us that the drive takes",
        ],
    ),
    row(
        0x60C2,
        "02",
        ByRig("period_us is not 1 to 255 times 1000"),
        [
            "power of ten of 60C2h:01, in s",
            "60C2h:01 is in milliseconds",
            "choose a period_us of whole milliseconds",
        ],
    ),
];

/// What the table says of an object; of those of all PDOs, under the first.
pub fn object_use(object: Object) -> Option<&'static ObjectUse> {
    let index = match object.index {
        0x1400..=0x15FF => 0x1400,
        0x1600..=0x17FF => 0x1600,
        0x1800..=0x19FF => 0x1800,
        0x1A00..=0x1BFF => 0x1A00,
        index => index,
    };
    let mut rows = OBJECTS.iter().filter(|row| row.index == index);
    let first = rows.clone().next()?;
    // Where entries differ, each has a row of one entry.
    let own = format!("{:02}", object.sub);
    Some(rows.find(|row| row.entries == own).unwrap_or(first))
}

/// What to set in the drive when an object disagrees.
pub fn remedy(index: u16) -> &'static str {
    object_use(Object::plain(index)).map_or("see its manual", |row| row.remedy)
}

/// The table as it stands in the documentation.
pub fn table() -> String {
    let mut text =
        "| object | meaning | needed | without it | what to set in the drive |\n|---|---|---|---|---|\n"
            .to_owned();
    for row in OBJECTS {
        let need = match row.need {
            Need::Needed => "yes".to_owned(),
            Need::Optional => "no".to_owned(),
            Need::ByRig(when) => format!("if {when}"),
        };
        let entries = row.entries.replace(", ", ", :");
        text += &format!(
            "| {:04X}h:{entries} | {} | {need} | {} | {} |\n",
            row.index, row.meaning, row.without, row.remedy
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_the_drives_objects_shows_this_table() {
        let page = include_str!("../../../docs/reference/cia402-objects.md");
        assert!(page.contains(&table()), "docs/reference/cia402-objects.md must contain\n{}", table());
    }

    #[test]
    fn an_entry_with_a_row_of_its_own_is_found_there() {
        assert_eq!(object_use(Object::entry(0x60C2, 2)).unwrap().meaning, "power of ten of 60C2h:01, in s");
        assert_eq!(object_use(Object::entry(0x1400, 5)).unwrap().entries, "05");
        assert_eq!(object_use(Object::entry(0x1802, 2)).unwrap().index, 0x1800);
        assert_eq!(object_use(Object::entry(0x607D, 2)).unwrap().index, 0x607D);
        assert_eq!(object_use(Object::plain(0x2000)), None);
    }
}
