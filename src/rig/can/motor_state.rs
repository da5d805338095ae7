//! The states of a motor from being connected to being without power again: for each, which targets may be sent, which checks
//! run, and what a fault leads to. The cycle, the documentation and the tests read this one table.

/// What the program has the motor do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MotorState {
    /// No power; the program looks where the handle is and whether sensors measure.
    Looking,
    /// The drive looks for its origin by itself.
    Homing,
    /// The motor is being given power.
    Enabling,
    /// The motor follows targets.
    Following,
    /// After a fault: the target comes to rest, and stays so that the person can let go.
    Holding,
    /// After a fault or the end of the session: the motor brakes.
    QuickStopping,
}

/// Which targets may be sent in a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AllowedTargets {
    /// None at all.
    None,
    /// Only the measured angle, and only within the angle limits.
    MeasuredAngle,
    /// Any that passes the guard: angle limits, speed limit x period, acceleration limit.
    Guarded,
    /// Only those that bring the target to rest, through the same guard.
    ComingToRest,
}

/// A check that the cycle makes in every period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// The frames of the motor arrive, once, whole and in time.
    MotorFrames,
    /// So do those of the sensors.
    SensorFrames,
    /// The program wakes up in time.
    WakeUp,
    /// Every channel is a number, and is not stale.
    Sensors,
    /// Measured torque within its limit.
    Torque,
    /// Measured angle within its limits.
    Angle,
    /// Measured speed within its limit.
    Speed,
    /// The motor reports no fault, and follows.
    MotorReport,
    /// The handle is near its target.
    Following,
    /// Heartbeats, emergency messages and errors of the bus are faults; without this check they are counted.
    Bus,
}

/// One line of the table.
#[derive(Debug, Clone, Copy)]
pub struct StateRule {
    /// The state.
    pub state: MotorState,
    /// Whether the motor may have power.
    pub has_power: bool,
    /// Targets that may be sent.
    pub targets: AllowedTargets,
    /// Checks that run.
    pub checks: &'static [Check],
    /// What a fault leads to.
    pub on_fault: OnFault,
}

/// What a fault leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnFault {
    /// The power stays off, and the motor is not armed.
    StaysOff,
    /// A quick stop, or no power at once, as `safe_state` says for the class of the fault; a hold is not possible here.
    Stop,
    /// What `safe_state` says for the class of the fault.
    SafeState,
    /// A quick stop. The fault that began the hold is excused.
    QuickStop,
    /// No power at once. The fault that began the stop is excused, and an angle beyond its limit as well: braking goes on.
    PowerOff,
}

/// Every state.
pub const STATES: &[StateRule] = {
    use Check::*;
    &[
        StateRule {
            state: MotorState::Looking,
            has_power: false,
            targets: AllowedTargets::None,
            checks: &[MotorFrames, SensorFrames, WakeUp, Sensors, Torque, Angle, Speed, Bus],
            on_fault: OnFault::StaysOff,
        },
        StateRule {
            state: MotorState::Homing,
            has_power: true,
            targets: AllowedTargets::None,
            checks: &[MotorFrames, SensorFrames, WakeUp, Sensors, Torque, Bus],
            on_fault: OnFault::Stop,
        },
        StateRule {
            state: MotorState::Enabling,
            has_power: true,
            targets: AllowedTargets::MeasuredAngle,
            checks: &[MotorFrames, SensorFrames, WakeUp, Sensors, Torque, Angle, Speed, Bus],
            on_fault: OnFault::Stop,
        },
        StateRule {
            state: MotorState::Following,
            has_power: true,
            targets: AllowedTargets::Guarded,
            checks: &[
                MotorFrames,
                SensorFrames,
                WakeUp,
                Sensors,
                Torque,
                Angle,
                Speed,
                MotorReport,
                Following,
                Bus,
            ],
            on_fault: OnFault::SafeState,
        },
        StateRule {
            state: MotorState::Holding,
            has_power: true,
            targets: AllowedTargets::ComingToRest,
            checks: &[MotorFrames, WakeUp, Torque, Angle, Speed, MotorReport, Following],
            on_fault: OnFault::QuickStop,
        },
        StateRule {
            state: MotorState::QuickStopping,
            has_power: true,
            targets: AllowedTargets::ComingToRest,
            checks: &[Torque, Speed],
            on_fault: OnFault::PowerOff,
        },
    ]
};

impl MotorState {
    /// The line of the table.
    pub fn rule(self) -> &'static StateRule {
        // The table has a line for every state; a test holds it.
        STATES.iter().find(|rule| rule.state == self).unwrap_or(&STATES[0])
    }

    /// Whether a check runs in this state.
    pub fn makes(self, check: Check) -> bool {
        self.rule().checks.contains(&check)
    }

    /// Name in documentation and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Looking => "looking",
            Self::Homing => "homing",
            Self::Enabling => "enabling",
            Self::Following => "following",
            Self::Holding => "holding",
            Self::QuickStopping => "quick stop",
        }
    }
}

impl AllowedTargets {
    /// Text of the printed table.
    pub fn text(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::MeasuredAngle => "the measured angle, within the angle limits",
            Self::Guarded => "within angle limits, speed limit x period and acceleration limit",
            Self::ComingToRest => "as when following, and never faster than the one before",
        }
    }
}

impl Check {
    /// Every check.
    pub const ALL: [Self; 10] = [
        Self::MotorFrames,
        Self::SensorFrames,
        Self::WakeUp,
        Self::Sensors,
        Self::Torque,
        Self::Angle,
        Self::Speed,
        Self::MotorReport,
        Self::Following,
        Self::Bus,
    ];

    /// Head of the check's column in the printed table.
    pub fn text(self) -> &'static str {
        match self {
            Self::MotorFrames => "motor's frames",
            Self::SensorFrames => "sensors' frames",
            Self::WakeUp => "wake-up",
            Self::Sensors => "sensors",
            Self::Torque => "torque",
            Self::Angle => "angle",
            Self::Speed => "speed",
            Self::MotorReport => "motor's report",
            Self::Following => "following error",
            Self::Bus => "bus and nodes",
        }
    }
}

impl OnFault {
    /// Text of the printed table.
    pub fn text(self) -> &'static str {
        match self {
            Self::StaysOff => "not armed",
            Self::Stop => "`safe_state` of its class, with a quick stop in place of a hold",
            Self::SafeState => "`safe_state` of its class",
            Self::QuickStop => "quick stop",
            Self::PowerOff => "no power",
        }
    }
}

/// The table as Markdown: a line for each state, a column for each check.
#[cfg(test)]
pub fn markdown() -> String {
    let heads = Check::ALL.map(Check::text).join(" | ");
    let mut text = format!("| state | power | targets | {heads} | a fault leads to |\n");
    text += &format!("|---|---|---|{}---|\n", ":-:|".repeat(Check::ALL.len()));
    for rule in STATES {
        let checks = Check::ALL.map(|check| if rule.state.makes(check) { "x" } else { "" }).join(" | ");
        text += &format!(
            "| {} | {} | {} | {checks} | {} |\n",
            rule.state.name(),
            if rule.has_power { "yes" } else { "no" },
            rule.targets.text(),
            rule.on_fault.text()
        );
    }
    text
}

/// The states as a Mermaid diagram. What a fault leads to comes from the table.
#[cfg(test)]
pub fn mermaid() -> String {
    let id = |state: MotorState| state.name().replace(' ', "_");
    let mut text = String::from("stateDiagram-v2\n    [*] --> no_power\n");
    for (from, to, why) in [
        ("no_power", MotorState::Homing, "armed; the drive looks for its origin"),
        ("no_power", MotorState::Looking, "armed; the motor has its origin, or takes the present place"),
        ("homing", MotorState::Looking, "origin found, power off"),
        ("looking", MotorState::Enabling, "the handle stands within the limits"),
        ("enabling", MotorState::Following, "the motor reports that it follows"),
    ] {
        text += &format!("    {from} --> {}: {why}\n", id(to));
    }
    for rule in STATES {
        let targets: &[&str] = match rule.on_fault {
            OnFault::StaysOff | OnFault::PowerOff => &["no_power"],
            OnFault::Stop => &["quick_stop", "no_power"],
            OnFault::SafeState => &["holding", "quick_stop", "no_power"],
            OnFault::QuickStop => &["quick_stop"],
        };
        for target in targets {
            text += &format!("    {} --> {target}: fault\n", id(rule.state));
        }
    }
    text += "    holding --> no_power: half a second is over\n    quick_stop --> no_power: at rest, or its time is over\n";
    text += "    following --> quick_stop: the session ends in a movement\n    following --> no_power: disarmed\n";
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_has_one_line_and_targets_only_where_they_are_checked() {
        for rule in STATES {
            assert_eq!(STATES.iter().filter(|other| other.state == rule.state).count(), 1);
            assert!(rule.has_power || rule.targets == AllowedTargets::None);
            // Whatever has power is watched by its torque at least.
            assert!(rule.state.makes(Check::Torque));
        }
        assert_eq!(STATES.len(), 6);
    }

    #[test]
    fn the_documented_states_are_those_of_the_cycle() {
        let docs = include_str!("../../../docs/reference/motor-states.md");
        for block in [markdown(), format!("```mermaid\n{}```\n", mermaid())] {
            assert!(docs.contains(&block), "docs/reference/motor-states.md must contain:\n{block}");
        }
    }
}
