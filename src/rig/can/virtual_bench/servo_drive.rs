//! A CiA 402 servo drive on a shaft without inertia: it is where its demand is.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use super::canopen_node::{CanopenNode, OPERATIONAL, PRE_OPERATIONAL};
use super::world::{BenchFault, Device, Wire};
use crate::rig::can::bus::Frame;
use crate::rig::can::cia402_state::{DriveState, Mode, Statusword};

const COUNTS_PER_RAD: f64 = 131_072.0 / TAU;
const RPDO: u16 = 0x200;
/// Mode, target torque and target position: lost with a restart, whatever else is kept.
const TOLD: [u16; 3] = [0x6060, 0x6071, 0x607A];
/// How often a drive that moves by itself updates its motion.
const SERVO_STEP: Duration = Duration::from_micros(500);

#[derive(Debug)]
pub struct EmulatedServoDrive {
    node: CanopenNode,
    state: DriveState,
    controlword: u16,
    /// Angle of the shaft from the encoder's zero, and the position that is counted from there.
    shaft_rad: f64,
    origin_rad: f64,
    /// Where the servo should be, and how far it has run away from there.
    demand_rad: f64,
    drift_rad: f64,
    speed_rad_s: f64,
    /// Cyclic synchronous position: from here to there within a period after SYNC.
    from_rad: f64,
    to_rad: f64,
    synced: Instant,
    updated: Instant,
    homed: bool,
    /// While homing moves the motor: until when, and how fast, rad/s.
    homing: Option<(Instant, f64)>,
    staged: Option<Vec<u8>>,
    heard: Option<Instant>,
    error_code: u16,
    pending_error: Option<Instant>,
    periods: u16,
    frozen: Option<(u16, i32)>,
    last_torque: i16,
    is_dead: bool,
}

impl EmulatedServoDrive {
    /// A drive whose shaft stands at `shaft_rad` from the zero of its encoder.
    pub fn new(now: Instant, shaft_rad: f64) -> Self {
        let mut node = CanopenNode::new(5, 1026);
        node.set(0x608F, 1, 131_072u32.to_le_bytes());
        node.set(0x608F, 2, 1u32.to_le_bytes());
        node.set(0x6076, 0, 10_000u32.to_le_bytes());
        node.set(0x6060, 0, [0]);
        node.set(0x607A, 0, 0i32.to_le_bytes());
        node.set(0x6071, 0, 0i16.to_le_bytes());
        // The limits are open until they are written.
        node.set(0x607D, 1, i32::MIN.to_le_bytes());
        node.set(0x607D, 2, i32::MAX.to_le_bytes());
        node.set(0x6072, 0, 5000u16.to_le_bytes());
        node.set(0x6065, 0, i32::MAX.to_le_bytes());
        node.set(0x6066, 0, 0u16.to_le_bytes());
        node.set(0x6080, 0, i32::MAX.to_le_bytes());
        Self {
            node,
            state: DriveState::SwitchOnDisabled,
            controlword: 0,
            shaft_rad,
            origin_rad: 0.0,
            demand_rad: shaft_rad,
            drift_rad: 0.0,
            speed_rad_s: 0.0,
            from_rad: shaft_rad,
            to_rad: shaft_rad,
            synced: now,
            updated: now,
            homed: false,
            homing: None,
            staged: None,
            heard: None,
            error_code: 0,
            pending_error: None,
            periods: 0,
            frozen: None,
            last_torque: 0,
            is_dead: false,
        }
    }

    fn mode(&self) -> i32 {
        self.node.number(0x6060, 0)
    }

    fn counts(&self) -> i32 {
        ((self.shaft_rad - self.origin_rad) * COUNTS_PER_RAD).round() as i32
    }

    fn statusword(&self) -> u16 {
        let bits = match self.state {
            DriveState::NotReady => 0x00,
            DriveState::SwitchOnDisabled => 0x40,
            DriveState::ReadyToSwitchOn => 0x21,
            DriveState::SwitchedOn => 0x23,
            DriveState::OperationEnabled => 0x27,
            DriveState::QuickStopActive => 0x07,
            DriveState::FaultReactionActive => 0x0F,
            DriveState::Fault => 0x08,
        };
        assert_eq!(Statusword(bits).state(), self.state);
        let mode = match self.mode() {
            6 => 0x400 | if self.homed { 0x1000 } else { 0 },
            8 if self.state == DriveState::OperationEnabled => 0x1000,
            _ => 0,
        };
        bits | 0x210 | mode
    }

    fn enter(&mut self, state: DriveState) {
        if state == DriveState::OperationEnabled && self.state != state {
            (self.from_rad, self.to_rad, self.speed_rad_s) = (self.shaft_rad, self.shaft_rad, 0.0);
            (self.demand_rad, self.drift_rad) = (self.shaft_rad, 0.0);
        }
        self.state = state;
    }

    fn obey(&mut self, word: u16, wire: &Wire) {
        let is_quick_stop = word & 0x06 == 0x02;
        let is_deaf = wire.has(BenchFault::ControlwordIgnored) || wire.has(BenchFault::LocalControl);
        if is_deaf || is_quick_stop && wire.has(BenchFault::QuickStopIgnored) {
            return;
        }
        let before = std::mem::replace(&mut self.controlword, word);
        let state = match (self.state, word & 0x8F) {
            (DriveState::Fault, _) if word & 0x80 != 0 && before & 0x80 == 0 => DriveState::SwitchOnDisabled,
            (DriveState::Fault | DriveState::FaultReactionActive, _) => self.state,
            (_, bits) if bits & 0x02 == 0 => DriveState::SwitchOnDisabled,
            (DriveState::OperationEnabled, bits) if bits & 0x06 == 0x02 => DriveState::QuickStopActive,
            (DriveState::QuickStopActive, _) => self.state,
            (_, bits) if bits & 0x06 == 0x02 => DriveState::SwitchOnDisabled,
            (_, bits) if bits & 0x07 == 0x06 => DriveState::ReadyToSwitchOn,
            (DriveState::ReadyToSwitchOn, bits) if bits & 0x07 == 0x07 => DriveState::SwitchedOn,
            (DriveState::SwitchedOn | DriveState::OperationEnabled, bits) if bits & 0x0F == 0x0F => {
                DriveState::OperationEnabled
            }
            (state, _) => state,
        };
        self.enter(state);
        let starts = word & 0x10 != 0 && before & 0x10 == 0 && state == DriveState::OperationEnabled;
        if starts && self.mode() == Mode::Homing as i32 && !wire.has(BenchFault::HomingStuck) {
            let moves = wire.faults.iter().find_map(|fault| match fault {
                BenchFault::HomingMoves(rad_s) => Some(*rad_s),
                _ => None,
            });
            match moves {
                Some(rad_s) => self.homing = Some((self.updated + Duration::from_millis(200), rad_s)),
                None => self.take_origin(wire),
            }
        }
    }

    fn take_origin(&mut self, wire: &Wire) {
        let misplaced = wire.faults.iter().find_map(|fault| match fault {
            BenchFault::HomingMisplaced(rad) => Some(*rad),
            _ => None,
        });
        // CiA 402: zero position = home position + home offset.
        let offset_rad = misplaced.unwrap_or(0.0) - f64::from(self.node.number(0x607C, 0)) / COUNTS_PER_RAD;
        (self.origin_rad, self.homed, self.homing) = (self.shaft_rad - offset_rad, true, None);
    }

    fn trip(&mut self, code: u16, now: Instant, wire: &mut Wire) {
        self.error_code = code;
        self.emergency(code, now, wire);
        if self.state.has_power() {
            self.enter(DriveState::FaultReactionActive);
        } else {
            self.enter(DriveState::Fault);
        }
    }

    fn emergency(&self, code: u16, now: Instant, wire: &mut Wire) {
        let [low, high] = code.to_le_bytes();
        wire.send(now, 0x080 + self.node.id, &[low, high, 1, 0, 0, 0, 0, 0]);
    }

    /// Moves the shaft on to `now`.
    fn move_on(&mut self, now: Instant, wire: &Wire) {
        let dt = now.saturating_duration_since(self.updated).as_secs_f64();
        self.updated = now;
        if let Some((until, rad_s)) = self.homing.filter(|_| self.state == DriveState::OperationEnabled) {
            self.demand_rad += rad_s * dt;
            if now >= until {
                self.take_origin(wire);
            }
        }
        let jammed = wire.faults.iter().any(|fault| matches!(fault, BenchFault::Jam { .. }));
        match self.state {
            DriveState::OperationEnabled if self.mode() == 8 => {
                let since_s = now.saturating_duration_since(self.synced).as_secs_f64();
                let period_s = f64::from(self.node.number(0x60C2, 1))
                    * 10f64.powi(self.node.number(0x60C2, 2) as u8 as i8 as i32);
                let part = (since_s / period_s).min(1.0);
                self.speed_rad_s =
                    if since_s <= 1.01 * period_s { (self.to_rad - self.from_rad) / period_s } else { 0.0 };
                self.demand_rad = self.from_rad + (self.to_rad - self.from_rad) * part;
            }
            DriveState::QuickStopActive | DriveState::FaultReactionActive => {
                let coasts =
                    self.state == DriveState::QuickStopActive && wire.has(BenchFault::QuickStopCoasts);
                let ramp = if coasts { 0.0 } else { f64::from(self.node.number(0x6085, 0)) / COUNTS_PER_RAD };
                let slower = ramp * dt;
                let left = (self.speed_rad_s.abs() - slower).max(0.0);
                self.demand_rad += self.speed_rad_s.signum() * 0.5 * (self.speed_rad_s.abs() + left) * dt;
                self.speed_rad_s = self.speed_rad_s.signum() * left;
                if left == 0.0 {
                    let quick_stop = self.state == DriveState::QuickStopActive;
                    self.enter(if quick_stop { DriveState::SwitchOnDisabled } else { DriveState::Fault });
                }
            }
            _ => self.speed_rad_s = 0.0,
        }
        if !self.state.has_power() {
            return;
        }
        for fault in &wire.faults {
            if let BenchFault::Runaway(rad_s) = fault {
                self.drift_rad += rad_s * dt;
            }
        }
        if !jammed {
            self.shaft_rad = self.demand_rad + self.drift_rad;
        }
    }

    /// What the drive watches by itself: the master's heartbeat, and the following error.
    fn supervise(&mut self, now: Instant, wire: &mut Wire) {
        let minded_ms = (self.node.number(0x1016, 1) & 0xFFFF) as u64;
        if let Some(heard) = self.heard.filter(|_| minded_ms > 0)
            && now.saturating_duration_since(heard) > Duration::from_millis(minded_ms)
        {
            self.heard = None;
            self.node.nmt = PRE_OPERATIONAL;
            self.trip(0x8130, now, wire);
        }
        let off = ((self.to_rad - self.shaft_rad).abs() * COUNTS_PER_RAD) as i32;
        let noticed = wire.has(BenchFault::Jam { noticed: true });
        if noticed && self.state == DriveState::OperationEnabled && off > self.node.number(0x6065, 0) {
            let since = *self.pending_error.get_or_insert(now);
            if now.saturating_duration_since(since)
                > Duration::from_millis(self.node.number(0x6066, 0) as u64)
            {
                self.trip(0x8611, now, wire);
            }
        } else {
            self.pending_error = None;
        }
    }

    fn on_sync(&mut self, now: Instant, wire: &mut Wire) {
        if self.node.nmt != OPERATIONAL {
            return;
        }
        if !wire.faults.iter().any(|f| matches!(f, BenchFault::CounterStale | BenchFault::TorqueStale)) {
            self.periods = self.periods.wrapping_add(1);
        }
        let mut torque = 2000 + (self.periods % 7) as i16;
        for fault in &wire.faults {
            match fault {
                BenchFault::TorqueInvalid => torque = i16::MIN,
                BenchFault::TorqueStale => torque = self.last_torque,
                BenchFault::Push(nm) => torque = (nm / 0.0005) as i16,
                _ => {}
            }
        }
        self.last_torque = torque;
        let mut told = (self.statusword(), self.counts());
        if wire.has(BenchFault::LocalControl) || wire.has(BenchFault::RemoteNeverShown) {
            told.0 &= !0x0200;
        }
        if wire.has(BenchFault::PositionFreeze) {
            told = *self.frozen.get_or_insert(told);
        }
        let mut first = [0u8; 8];
        first[..2].copy_from_slice(&told.0.to_le_bytes());
        first[2..6].copy_from_slice(&told.1.to_le_bytes());
        first[6..].copy_from_slice(&torque.to_le_bytes());
        let [low, high] = self.periods.to_le_bytes();
        let flexor = 100 + (self.periods % 5) as u8;
        let extensor = if wire.has(BenchFault::EmgFrozen) { 100 } else { flexor };
        wire.send(now, 0x180 + self.node.id, &first);
        wire.send(now, 0x280 + self.node.id, &[low, high, flexor, 0, extensor, 0]);
        if let Some(data) = self.staged.take() {
            let had_power = self.state.has_power();
            self.obey(u16::from_le_bytes([data[0], data[1]]), wire);
            let counts = i32::from_le_bytes([data[2], data[3], data[4], data[5]]);
            let scale = wire.faults.iter().find_map(|fault| match fault {
                BenchFault::TargetScaled(scale) => Some(*scale),
                _ => None,
            });
            let told_rad = f64::from(counts) / COUNTS_PER_RAD;
            let offset_rad = f64::from(self.node.number(0x60B0, 0)) / COUNTS_PER_RAD;
            let target_rad = scale.unwrap_or(1.0) * told_rad + offset_rad + self.origin_rad;
            if self.state == DriveState::OperationEnabled && self.mode() == 8 {
                if !had_power {
                    wire.targets.powered_at(self.shaft_rad - self.origin_rad);
                }
                wire.targets.received(told_rad);
            }
            (self.from_rad, self.to_rad) = (self.demand_rad, target_rad);
        } else {
            self.from_rad = self.demand_rad;
        }
        self.synced = now;
    }
}

impl Device for EmulatedServoDrive {
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire) {
        if self.is_dead {
            return;
        }
        // What is read is what there is now.
        let (status, counts) = (self.statusword(), self.counts());
        self.node.set(0x6041, 0, status.to_le_bytes());
        self.node.set(0x6064, 0, counts.to_le_bytes());
        self.node.set(0x603F, 0, self.error_code.to_le_bytes());
        let mode = [self.mode() as u8];
        self.node.set(0x6061, 0, mode);
        match frame.id {
            0x080 => self.on_sync(now, wire),
            id if id == RPDO + self.node.id => self.staged = Some(frame.data().to_vec()),
            0x701 => self.heard = Some(now),
            _ => {
                let written = self.node.receive(frame, now, wire);
                if written == Some((0x6040, 0)) {
                    self.obey(self.node.number(0x6040, 0) as u16, wire);
                }
                if let Some((index, _)) = written
                    && wire.has(BenchFault::RebootWhenWritten(index))
                {
                    wire.faults.retain(|fault| *fault != BenchFault::RebootWhenWritten(index));
                    self.node.objects.remove(&(0x1016, 1));
                    self.strike(BenchFault::RebootWithSettings, now, wire);
                }
            }
        }
    }

    fn advance(&mut self, now: Instant, wire: &mut Wire) {
        if self.is_dead {
            return;
        }
        self.move_on(now, wire);
        self.supervise(now, wire);
        self.node.advance(now, wire);
    }

    fn next_event(&self) -> Option<Instant> {
        if self.is_dead {
            return None;
        }
        let moving = self.state.has_power() || self.heard.is_some();
        self.node.next_event().into_iter().chain(moving.then_some(self.updated + SERVO_STEP)).min()
    }

    fn strike(&mut self, fault: BenchFault, now: Instant, wire: &mut Wire) {
        match fault {
            BenchFault::HeartbeatStop => self.node.stop_heartbeat(),
            BenchFault::Error { code, fatal: true } => self.trip(code, now, wire),
            BenchFault::Error { code, fatal: false } => self.emergency(code, now, wire),
            BenchFault::NmtDrop => self.node.nmt = PRE_OPERATIONAL,
            BenchFault::Reboot => {
                let shaft_rad = self.shaft_rad;
                *self = Self::new(now, shaft_rad);
                wire.send(now, 0x700 + self.node.id, &[0]);
            }
            BenchFault::RebootWithSettings => {
                let mut objects = std::mem::take(&mut self.node.objects);
                // Commands and targets are no settings: the memory does not keep them.
                TOLD.iter().for_each(|index| drop(objects.remove(&(*index, 0))));
                let shaft_rad = self.shaft_rad;
                *self = Self::new(now, shaft_rad);
                self.origin_rad = shaft_rad;
                self.node.objects.extend(objects);
                wire.send(now, 0x700 + self.node.id, &[0]);
            }
            BenchFault::Held(index, value) => self.node.set(index, 0, value.to_le_bytes()),
            BenchFault::PowerLoss => {
                self.enter(DriveState::SwitchOnDisabled);
                self.is_dead = true;
            }
            _ => {}
        }
    }

    fn motor(&self) -> Option<(bool, f64)> {
        Some((self.state.has_power(), self.shaft_rad - self.origin_rad))
    }
}
