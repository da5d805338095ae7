//! The start position of a session that is resumed: whether the motor still has it, or where the handle must be.
//!
//! A motor that takes the present place of the handle for its start position does so once in a session. Done again
//! somewhere else, it would shift every later ramp and every limit against the earlier trials. So a resumed session keeps
//! the origin that the motor still has. If the motor cannot show that it has it, the operator must say that the handle
//! stands at the start position, and what the motor reports is compared with that as far as it goes.

use super::drive::{HANDLE_AT_START_RAD, OriginReport};
use super::fault::CanFault;
use super::motor::CanMotor;
use super::units::JointAngle;

/// How a resumed session gets its start position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResumedOrigin {
    /// The motor finds it by itself at every arming, in the same place.
    FoundByMotor,
    /// The motor still has the origin of the session.
    Kept {
        /// Where the handle is, rad from the start position.
        angle_rad: f64,
    },
    /// The next arming takes the present place of the handle for the start position.
    SetAnew {
        /// Angle that the motor reports before that, rad; it means nothing if the motor was restarted.
        reported_rad: Option<f64>,
    },
}

/// Why a session with a motor cannot be resumed as it was asked for.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum OriginError {
    /// The operator must say where the handle is.
    #[error(
        "the motor {}, and would take the present place of the handle for the start position: elsewhere, all ramps and \
         limits would be shifted against the session's earlier trials. Put the handle where it stood when the session \
         began, then resume with --home-here; --yes alone does not say so",
        if *was_restarted {
            "has lost the session's start position (it was restarted, its position sensor failed, or it was armed for something else)"
        } else {
            "cannot show that it still has the session's start position"
        }
    )]
    WordNeeded {
        /// The motor shows that it has lost the origin; otherwise it cannot tell.
        was_restarted: bool,
    },
    /// The handle is not at the start position, although the operator said so.
    #[error(
        "--home-here says that the handle stands at the start position, but the motor{} has it at {angle_rad:.4} rad: \
         homing here would shift all ramps and limits by so much. {}",
        if *is_sure { ", which still has the session's origin," } else { "" },
        if *is_sure {
            "Resume without --home-here: the motor will go to its start position by itself"
        } else {
            "Put the handle where the motor reads 0; if the motor was switched off since the last trial, its angle means \
             nothing: switch it off and on again, put the handle at the start position, and resume with --home-here"
        }
    )]
    HandleElsewhere {
        /// Where the motor has the handle, rad.
        angle_rad: f64,
        /// The motor shows that this is in the session's origin; otherwise it may be.
        is_sure: bool,
    },
    /// The motor could not be asked.
    #[error("the motor could not be asked for its start position: {0}")]
    Fault(#[from] CanFault),
}

impl CanMotor {
    /// Asks the motor for the origin of a session that is to be resumed, and decides how the session goes on. The motor gets
    /// no power. `was_armed` says that the session had armed it before, and `stands_at_start` that the operator says that
    /// the handle stands at the start position.
    ///
    /// # Errors
    /// If the operator's word is needed, or contradicts what the motor reports.
    pub fn resume_origin(
        &mut self,
        was_armed: bool,
        stands_at_start: bool,
    ) -> Result<ResumedOrigin, OriginError> {
        if !self.connection.drive.takes_present_position() {
            return Ok(ResumedOrigin::FoundByMotor);
        }
        if !was_armed {
            // There are no earlier trials to be shifted against.
            return Ok(ResumedOrigin::SetAnew { reported_rad: None });
        }
        let limits = *self.dry_run.limits();
        let connection = &mut self.connection;
        connection.check_alone()?;
        let OriginReport { is_kept, angle } =
            connection.drive.ask_origin(&mut connection.link, &connection.file, &limits)?;
        let angle_rad = angle.map(|JointAngle(angle_rad)| angle_rad);
        let elsewhere = angle_rad.filter(|angle_rad| angle_rad.abs() > HANDLE_AT_START_RAD);
        let [low_rad, high_rad] = limits.angle_rad;
        match (is_kept, stands_at_start, elsewhere) {
            (Some(true), true, Some(angle_rad)) => {
                Err(OriginError::HandleElsewhere { angle_rad, is_sure: true })
            }
            (Some(true), ..) => {
                connection.drive.adopt_origin(&limits);
                self.origin_is_adopted = true;
                Ok(ResumedOrigin::Kept { angle_rad: angle_rad.unwrap_or(0.0) })
            }
            (_, false, _) => Err(OriginError::WordNeeded { was_restarted: is_kept == Some(false) }),
            // An angle within the limits is likely to be in the session's origin; a motor that was restarted begins at 0.
            (None, true, Some(angle_rad)) if (low_rad..=high_rad).contains(&angle_rad) => {
                Err(OriginError::HandleElsewhere { angle_rad, is_sure: false })
            }
            (_, true, _) => Ok(ResumedOrigin::SetAnew { reported_rad: angle_rad }),
        }
    }

    /// Whether the first arming takes the present place of the handle for the start position.
    pub fn sets_origin_here(&self) -> bool {
        self.connection.drive.takes_present_position() && !self.origin_is_adopted
    }

    /// Whether the motor searches its home at every arming, and may move the handle over its whole range.
    pub fn homes_by_moving(&self) -> bool {
        self.connection.drive.homes_by_moving()
    }

    /// Whether arming the motor again needs the operator's word that the handle stands at the start position: the motor took its
    /// place there once, and would not show that it was restarted since.
    pub fn rearms_at_start(&self) -> bool {
        let drive = &self.connection.drive;
        drive.takes_present_position() && !drive.shows_lost_origin()
    }
}
