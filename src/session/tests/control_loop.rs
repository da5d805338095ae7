//! The loop around the machine: the motor is made safe before the operator reads why.

use std::cell::RefCell;
use std::rc::Rc;

use super::*;
use crate::protocol::Limits;
use crate::rig::{Armed, ArmingConsent, Fault, Rig};

/// What was done, in order, by everybody.
type Deeds = Rc<RefCell<Vec<&'static str>>>;

/// A motor that follows for a while, and then is where the session allows nobody to be.
struct Stray {
    deeds: Deeds,
    samples: u32,
    keeps_power: bool,
}

impl Rig for Stray {
    type Armed = Self;

    fn arm(self, _: ArmingConsent, _: &Limits) -> Result<Self, (Self, Fault)> {
        Ok(self)
    }

    fn power_may_be_on(&self) -> bool {
        self.keeps_power
    }
}

impl Armed for Stray {
    type Disarmed = Self;

    fn exchange(&mut self, command: &Command) -> Result<Sample, Fault> {
        if self.samples > 0 && command.motor == Motor::Safe {
            self.deeds.borrow_mut().push("motor made safe");
        }
        self.samples += 1;
        let theta_m_rad = if self.samples > 10 { 1.0 } else { 0.0 };
        Ok(Sample { theta_m_rad, ..Sample::default() })
    }

    fn rescale_emg(&mut self, _: [f64; 2]) {}

    fn disarm(self) -> Self {
        self.deeds.borrow_mut().push("power off");
        self
    }
}

struct Witness(Deeds);

impl Operator for Witness {
    fn poll_command(&mut self, _: &Machine) -> Option<Event> {
        None
    }
    fn wait_for_command(&mut self, machine: &Machine) -> Event {
        if machine.phase() == Phase::Ready { Event::Start } else { Event::Abort }
    }
    fn command_refused(&mut self, _: Event, _: Phase) {}
    fn arming_failed(&mut self, _: Fault) {}
    fn fault_occurred(&mut self, _: Fault) {
        self.0.borrow_mut().push("operator informed");
    }
    fn power_not_confirmed(&mut self) {
        self.0.borrow_mut().push("operator warned");
    }
}

/// Writes down faults, or fails at the first sample.
struct Pen {
    deeds: Deeds,
    fails: bool,
}

impl StepConsumer for Pen {
    type Error = &'static str;

    fn consume(&mut self, step: &Step, _: &Progress) -> Result<(), &'static str> {
        if self.fails {
            self.deeds.borrow_mut().push("pen broke");
            return Err("the pen broke");
        }
        if step.phase == Phase::Faulted && step.transition.is_some() {
            self.deeds.borrow_mut().push("written down");
        }
        Ok(())
    }
}

fn conducted(fails: bool, keeps_power: bool) -> (Vec<&'static str>, bool) {
    let deeds = Deeds::default();
    let rig = Stray { deeds: deeds.clone(), samples: 0, keeps_power };
    let mut machine = Machine::new(Arc::new(settings()));
    let mut pen = Pen { deeds: deeds.clone(), fails };
    let ended = run_control_loop(rig, &mut machine, &mut Witness(deeds.clone()), &mut Unpaced, &mut pen);
    let deeds = deeds.borrow().clone();
    (deeds, ended.is_ok())
}

#[test]
fn a_fault_that_the_session_finds_is_told_and_written_down_when_the_motor_has_no_power() {
    let (deeds, ended_well) = conducted(false, false);
    assert!(ended_well);
    assert_eq!(deeds, ["motor made safe", "power off", "operator informed", "written down"]);
}

#[test]
fn a_session_that_cannot_be_kept_leaves_a_motor_that_is_safe() {
    let (deeds, ended_well) = conducted(true, false);
    assert!(!ended_well);
    assert_eq!(deeds, ["pen broke", "motor made safe", "power off"]);
}

/// Only the log of the bus said so: the page and the terminal told of an ordinary end.
#[test]
fn the_operator_is_warned_of_a_motor_whose_power_is_not_known_to_be_off_before_anything_is_written_down() {
    let (deeds, _) = conducted(false, true);
    assert_eq!(
        deeds,
        ["motor made safe", "power off", "operator warned", "operator informed", "written down"]
    );
    let (deeds, _) = conducted(true, true);
    assert_eq!(deeds, ["pen broke", "motor made safe", "power off", "operator warned"]);
}
