//! Which motor the small motions of arming have proved. They need a free handle, so a rig file may say that they were made before;
//! it says so by naming the motor and the settings that were proved, and holds for no other.

use super::fault::CanFault;

/// The motor that is on the bus, and whether it was proved.
#[derive(Debug, Clone, Default)]
pub struct ProvedMotor {
    /// What the rig file gives as proved.
    given: Option<String>,
    /// What is on the bus; `None` before it was asked, or if it does not tell.
    present: Option<String>,
    /// It passed the small motions since the program was started.
    has_passed: bool,
}

impl ProvedMotor {
    /// As a rig file says.
    pub fn new(given: Option<&str>) -> Self {
        Self { given: given.map(str::to_owned), ..Self::default() }
    }

    /// This motor, with the settings that its proof depends on, is on the bus.
    ///
    /// # Errors
    /// The rig file says that another was proved, or this one does not tell which it is.
    pub fn identify(&mut self, present: Option<String>) -> Result<(), CanFault> {
        self.has_passed &= self.present == present;
        self.present = present;
        match (&self.given, &self.present) {
            (None, _) => Ok(()),
            (Some(_), None) => Err(CanFault::ProofWithoutSerialNumber),
            (given, present) if given == present => Ok(()),
            _ => Err(CanFault::ProofOfOtherMotor),
        }
    }

    /// Whether the motor on the bus needs no small motions any more.
    pub fn is_proved(&self) -> bool {
        self.given.is_some() || self.has_passed
    }

    /// The small motions were made, and nothing was found.
    pub fn pass(&mut self) {
        self.has_passed = true;
    }

    /// The line for the rig file, if the motor was proved since the program was started.
    pub fn line(&self) -> Option<&str> {
        self.present.as_deref().filter(|_| self.has_passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor(name: &str) -> Option<String> {
        Some(name.to_owned())
    }

    #[test]
    fn proof_of_a_rig_file_holds_for_the_motor_that_it_names() {
        let mut proof = ProvedMotor::new(Some("one"));
        assert_eq!(proof.identify(motor("one")), Ok(()));
        assert!(proof.is_proved() && proof.line().is_none());
        assert_eq!(proof.identify(motor("other")), Err(CanFault::ProofOfOtherMotor));
        assert_eq!(proof.identify(None), Err(CanFault::ProofWithoutSerialNumber));
    }

    #[test]
    fn proof_of_this_process_ends_when_the_motor_is_another() {
        let mut proof = ProvedMotor::new(None);
        assert_eq!(proof.identify(motor("one")), Ok(()));
        assert!(!proof.is_proved());
        proof.pass();
        assert_eq!(proof.identify(motor("one")), Ok(()));
        assert!(proof.is_proved() && proof.line() == Some("one"));
        assert_eq!(proof.identify(motor("other")), Ok(()));
        assert!(!proof.is_proved() && proof.line().is_none());
    }
}
