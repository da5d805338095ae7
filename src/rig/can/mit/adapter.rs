//! What the cycle asks of a motor, in MIT mode.

use std::time::Instant;

use super::device::{MIT_ATTEMPTS, MIT_REPLY_TIMEOUT, Mit, MitCommand};
use super::frame::{ENTER, LEAVE};
use super::proof::prove;
use super::trusted_motion::Misfit;
use crate::rig::Origin;
use crate::rig::can::bus::{Arrival, Frame};
use crate::rig::can::canopen::{ErrorPolicy, Link, MonitoredNode, cob};
use crate::rig::can::drive::{
    Drive, DriveRequest, HANDLE_AT_START_RAD, MotionMonitor, OriginReport, PowerState,
};
use crate::rig::can::fault::CanFault;
use crate::rig::can::file::CanRigFile;
use crate::rig::can::limits::{HandleLimits, LimitsConfirmed};
use crate::rig::can::pdo_decoder::Readings;
use crate::rig::can::target_motion::Profile;
use crate::rig::can::units::JointAngle;

impl Drive for Mit {
    fn prepare(
        &mut self,
        link: &mut Link,
        file: &CanRigFile,
        limits: &HandleLimits,
    ) -> Result<LimitsConfirmed, CanFault> {
        self.check_reach(limits)?;
        self.proof.identify(Some(self.identity()))?;
        self.limits = Some(*limits);
        self.forget_place();
        self.probe = None;
        self.ask(link, &LEAVE)?;
        self.sensors.prepare(link, file)?;
        Ok(LimitsConfirmed::held_by_program())
    }

    fn proved(&self) -> Option<&str> {
        self.proof.line()
    }

    fn monitored_nodes(&self) -> Vec<MonitoredNode> {
        self.sensors.monitored_nodes()
    }

    fn start(
        &mut self,
        link: &mut Link,
        limits: &HandleLimits,
        monitor: &mut dyn MotionMonitor,
    ) -> Result<(), CanFault> {
        self.sensors.start(link)?;
        link.set_error_policy(ErrorPolicy::Fault);
        self.target_rad = None;
        self.origin = Origin::at_arming(self.motor.zero_here, self.zeroed);
        let is_kept = self.zeroed;
        if self.motor.zero_here && !is_kept {
            self.make_zero(link)?;
        }
        let reply = self.ask(link, &LEAVE)?;
        let angle_rad = self.handle_rad(&reply);
        let near_rad = HANDLE_AT_START_RAD + self.motor.angle_step_rad();
        if is_kept && !(-near_rad..=near_rad).contains(&angle_rad) {
            return Err(CanFault::OriginNotConfirmed { angle_rad });
        }
        limits.check_place(JointAngle(angle_rad))?;
        if self.proof.is_proved() {
            return Ok(());
        }
        let proved = prove(self, link, limits, monitor);
        self.probe = None;
        let left = self.send_leave(link);
        self.motion.restart();
        proved?;
        left?;
        self.proof.pass();
        Ok(())
    }

    fn send_target(
        &mut self,
        _link: &mut Link,
        target: JointAngle,
        _shown_nm: f64,
        request: DriveRequest,
    ) -> Result<(), CanFault> {
        self.next = match request {
            // A motor that is not in motor mode answers this one, too, and stays without power.
            // It has no ramp of its own to stop on; asked for one, it is without power.
            DriveRequest::None | DriveRequest::RemovePower | DriveRequest::QuickStop => MitCommand::Leave,
            DriveRequest::Enable if !self.in_motor_mode && self.motion.is_known() => MitCommand::Enter,
            _ if !self.in_motor_mode => MitCommand::Leave,
            DriveRequest::Enable | DriveRequest::Follow => {
                let step_rad = target.0 - self.target_rad.unwrap_or(target.0);
                MitCommand::Toward(target.0, step_rad / self.period.as_secs_f64())
            }
        };
        Ok(())
    }

    fn send_sync(&mut self, link: &mut Link) -> Result<(), CanFault> {
        self.has_replied = false;
        self.target_rad = match self.next {
            MitCommand::Toward(target_rad, _) => Some(target_rad),
            _ => None,
        };
        match self.command_at(link.now()) {
            MitCommand::Silence => self.has_replied = true,
            MitCommand::Leave | MitCommand::Toward(..) => self.send_leave(link)?,
            MitCommand::Enter => {
                self.send_no_gains(link)?;
                self.send_raw(link, &ENTER)?;
                // One that goes on with what it was told before is told to do nothing.
                self.send_no_gains(link)?;
                self.in_motor_mode = true;
            }
            MitCommand::Act(impedance) => {
                let frame = self.ranges.encode(&impedance)?;
                self.send_raw(link, &frame)?;
            }
        }
        Ok(link.send(&Frame::new(cob::SYNC, &[]))?)
    }

    fn handle_frame(&mut self, frame: &Frame, arrival: Arrival) -> Result<bool, CanFault> {
        let data = frame.data();
        if frame.id != self.motor.reply_id || data.first() != Some(&(self.motor.id as u8)) {
            return Ok(false);
        }
        let [_, a, b, c, d, e, rest @ ..] = data else {
            return Err(CanFault::Malformed { id: frame.id, length: data.len() as u8, expected: 8 });
        };
        let error = rest.get(1).copied().unwrap_or(0);
        let reply = self.ranges.decode([*a, *b, *c, *d, *e], error)?;
        self.check.believe(self.handle_rad(&reply), arrival)?;
        self.judge_reply(&reply);
        self.reply = Some(reply);
        self.has_replied = true;
        Ok(true)
    }

    fn has_replied(&self) -> bool {
        self.has_replied
    }

    fn reply_id(&self) -> Option<u16> {
        Some(self.motor.reply_id)
    }

    fn angle(&self, _readings: &Readings, _sample: usize) -> JointAngle {
        JointAngle(self.check.angle_rad().unwrap_or(f64::NAN))
    }

    fn check(&self, _readings: &Readings, _now: Instant) -> Result<(), CanFault> {
        let error = self.reply.map_or(0, |reply| reply.error);
        if error != 0 || !self.in_motor_mode {
            return Err(CanFault::MotorError { code: u32::from(error) });
        }
        self.motion.misfit().map_or(Ok(()), |Misfit { reported_rad_s, measured_rad_s }| {
            Err(CanFault::SpeedDisagrees { reported_rad_s, measured_rad_s })
        })
    }

    fn power(&self, _readings: &Readings) -> PowerState {
        match (self.in_motor_mode, self.following) {
            (true, true) => PowerState::Following,
            (true, false) => PowerState::Changing,
            (false, _) => PowerState::Off,
        }
    }

    /// It goes there as soon as it is told, and its reply comes after that.
    fn target_delay_periods(&self) -> usize {
        1
    }

    fn approach(&self) -> Profile {
        Profile::of_speed(self.motor.go_to_start_rad_s)
    }

    fn angle_resolution_rad(&self) -> f64 {
        self.motor.angle_step_rad()
    }

    fn period_complete(&mut self, _readings: &Readings) {
        self.following = self.in_motor_mode && matches!(self.next, MitCommand::Toward(..));
    }

    fn takes_present_position(&self) -> bool {
        self.motor.zero_here
    }

    /// The motor has nothing that tells whether it was restarted.
    fn ask_origin(
        &mut self,
        link: &mut Link,
        _file: &CanRigFile,
        _limits: &HandleLimits,
    ) -> Result<OriginReport, CanFault> {
        self.forget_place();
        // The reply to it tells the angle, and it gives no power.
        let reply = self.ask(link, &LEAVE)?;
        Ok(OriginReport { is_kept: None, angle: Some(JointAngle(self.handle_rad(&reply))) })
    }

    fn adopt_origin(&mut self, _limits: &HandleLimits) {
        self.zeroed = true;
    }

    fn origin(&self) -> Origin {
        self.origin
    }

    fn power_off(&mut self, link: &mut Link) -> Result<Option<CanFault>, CanFault> {
        self.probe = None;
        for _ in 0..MIT_ATTEMPTS {
            self.in_motor_mode = true;
            // Without gains if that can be said, without power in any case.
            let _ = self.send_leave(link);
            // The replies to earlier commands look like the one to this. Asked again when they are in, it answers that it has heard.
            if !self.becomes_silent(link)? || self.send_leave(link).is_err() {
                continue;
            }
            if self.replies_by(link, link.now() + MIT_REPLY_TIMEOUT)? {
                self.sensors.release(link)?;
                return Ok(None);
            }
        }
        Err(CanFault::PowerNotConfirmed)
    }
}
