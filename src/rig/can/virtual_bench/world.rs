//! The bus and everything on it, in virtual time.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use super::shaft::Shaft;
use super::target_log::TargetLog;
use crate::rig::can::bus::{Arrival, CanBus, ControllerError, Frame, Received};
use crate::timing::{Clock, VirtualClock};

/// Time from a frame being sent to its arrival.
const FRAME_TIME: Duration = Duration::from_micros(50);

/// What goes wrong. Frame faults act on every device, the others on the devices that they concern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BenchFault {
    /// The motor sends no heartbeat any more.
    HeartbeatStop,
    /// The motor reports an error; a fatal one also sends a drive to its fault reaction.
    Error { code: u16, fatal: bool },
    /// The motor falls back to PRE-OPERATIONAL.
    NmtDrop,
    /// The motor restarts.
    Reboot,
    /// The motor restarts, and has its settings in a memory that keeps them.
    RebootWithSettings,
    /// The motor restarts with its settings once this object was written; what its watchdogs were told is gone.
    RebootWhenWritten(u16),
    /// An object held this value when the program came.
    Held(u16, i32),
    /// The motor loses its supply: no power, no frames.
    PowerLoss,
    /// The servo runs away from its target, rad/s.
    Runaway(f64),
    /// The shaft jams; a drive may fail to notice.
    Jam { noticed: bool },
    /// Statusword and position keep arriving, unchanged.
    PositionFreeze,
    /// Somebody pushes on the handle with this torque, N m.
    Push(f64),
    /// The torque channel says that it has no measurement.
    TorqueInvalid,
    /// Torque and counter stand still.
    TorqueStale,
    /// The EMG of the extensor stands still.
    EmgFrozen,
    /// The counter stands still.
    CounterStale,
    /// No frame reaches the master.
    Silent,
    /// No frame with this identifier reaches the master.
    Dropped(u16),
    /// No frame of the master reaches a device.
    Deaf,
    /// Frames reach the master late.
    Delayed(Duration),
    /// Frames with this identifier arrive twice.
    Duplicated(u16),
    /// A bit of the payload of frames with this identifier is flipped.
    FlippedBit { id: u16, bit: usize },
    /// Frames with this identifier lack their last byte.
    Shortened(u16),
    /// Frames with identifier 010h arrive so often, 1/s.
    Flood(u32),
    /// The controller reports an error.
    Controller(ControllerError),
    /// Bytes arrive that are no frame.
    Garbled,
    /// The adapter is gone.
    AdapterGone,
    /// An SDO write of this object is acknowledged and not done.
    IgnoredWrite(u16),
    /// This object reads as this value, whatever was written.
    WrongReading(u16, u8, u32),
    /// An SDO access to this object is aborted with this code.
    Aborted(u16, u32),
    /// An SDO access to this object is not answered.
    Unanswered(u16),
    /// The homing of the drive never ends.
    HomingStuck,
    /// Homing at the present position moves the motor first, rad/s for 200 ms.
    HomingMoves(f64),
    /// After homing the drive counts from so far off, rad.
    HomingMisplaced(f64),
    /// The drive goes on as if it had got no controlword.
    ControlwordIgnored,
    /// Somebody commands the drive with another tool: it says so, and minds no controlword.
    LocalControl,
    /// The drive never says whether it minds its controlword.
    RemoteNeverShown,
    /// The drive goes on as if it had not been told to make a quick stop.
    QuickStopIgnored,
    /// The drive says that it makes a quick stop, and goes on at its speed.
    QuickStopCoasts,
    /// The motor reports this position, rad, and a correct one after it.
    MisreadOnce(f64),
    /// The motor reports this position, rad, from now on.
    Misread(f64),
    /// The drive takes target positions in another unit: it goes so many times as far.
    TargetScaled(f64),
    /// The drive acts on SDOs, but none of its PDOs comes and no heartbeat.
    SdoOnly,
}

/// Frames on their way to the master, and faults in force.
#[derive(Debug, Default)]
pub struct Wire {
    pub faults: Vec<BenchFault>,
    /// What the motor was told while it had power.
    pub targets: TargetLog,
    /// Sorted by time of arrival.
    arriving: Vec<(Instant, Received)>,
}

impl Wire {
    pub fn has(&self, fault: BenchFault) -> bool {
        self.faults.contains(&fault)
    }

    /// A frame from a device to the master.
    pub fn send(&mut self, now: Instant, id: u16, data: &[u8]) {
        let (mut at, mut bytes, mut times) = (now + FRAME_TIME, data.to_vec(), 1);
        for fault in &self.faults {
            match *fault {
                BenchFault::Silent => return,
                BenchFault::SdoOnly if !(0x580..0x600).contains(&id) => return,
                BenchFault::Dropped(dropped) if dropped == id => return,
                BenchFault::Delayed(by) => at += by,
                BenchFault::Duplicated(doubled) if doubled == id => times = 2,
                BenchFault::FlippedBit { id: hit, bit } if hit == id => bytes[bit / 8] ^= 1 << (bit % 8),
                BenchFault::Shortened(hit) if hit == id => drop(bytes.pop()),
                _ => {}
            }
        }
        for _ in 0..times {
            self.put(at, Received::Frame(Frame::new(id, &bytes), Arrival::at(at)));
        }
    }

    /// The wrong position that the motor is to report, if any, rad.
    pub fn misread(&mut self) -> Option<f64> {
        let once = self.faults.iter().position(|fault| matches!(fault, BenchFault::MisreadOnce(_)));
        if let Some(BenchFault::MisreadOnce(misread_rad)) = once.map(|at| self.faults.remove(at)) {
            return Some(misread_rad);
        }
        self.faults.iter().find_map(|fault| match fault {
            BenchFault::Misread(misread_rad) => Some(*misread_rad),
            _ => None,
        })
    }

    pub fn put(&mut self, at: Instant, received: Received) {
        let place = self.arriving.partition_point(|(time, _)| *time <= at);
        self.arriving.insert(place, (at, received));
    }
}

/// Something on the bus.
pub trait Device: std::fmt::Debug + Send {
    /// A frame of the master.
    fn receive(&mut self, frame: &Frame, now: Instant, wire: &mut Wire);

    /// Everything that the device does by itself until `now`.
    fn advance(&mut self, now: Instant, wire: &mut Wire);

    /// When the device will next do something by itself.
    fn next_event(&self) -> Option<Instant>;

    /// A fault strikes now. What is in force for long is read from the wire.
    fn strike(&mut self, _fault: BenchFault, _now: Instant, _wire: &mut Wire) {}

    /// Whether the motor has power, and the angle of the handle, rad; `None` for what is no motor.
    fn motor(&self) -> Option<(bool, f64)> {
        None
    }

    /// The shaft of a motor that has one.
    fn shaft(&mut self) -> Option<&mut Shaft> {
        None
    }

    /// Commands that made torque after the motor's own watchdog had let go of the shaft.
    fn times_woken(&self) -> u32 {
        0
    }

    /// Parameters that were written by number.
    fn times_written(&self) -> u32 {
        0
    }
}

/// The devices, the wire between them and the master, and what the motor did.
#[derive(Debug)]
pub struct World {
    pub clock: VirtualClock,
    pub wire: Wire,
    pub devices: Vec<Box<dyn Device>>,
    next_flood: Option<Instant>,
    /// The fault that strikes when the handle comes below an angle, rad.
    pub strike_below_rad: Option<(f64, BenchFault)>,
    /// When every fault ends.
    pub faults_end: Option<Instant>,
    /// When the operator stops the program, and the flag that says so.
    pub stop_at: Option<(Instant, Arc<AtomicBool>)>,
    /// When the power went on or off.
    pub power: Vec<(Instant, bool)>,
    /// Lowest and highest angle of the handle so far, rad.
    pub angles_rad: [f64; 2],
    /// Frames sent by the master, and how many of them were SYNC.
    pub frames_sent: u64,
    pub syncs_sent: u64,
    /// Angle of the handle at the latest SYNC, rad.
    pub synced_rad: f64,
}

impl World {
    pub fn new(clock: VirtualClock, devices: Vec<Box<dyn Device>>) -> Self {
        Self {
            clock,
            wire: Wire::default(),
            devices,
            next_flood: None,
            strike_below_rad: None,
            faults_end: None,
            stop_at: None,
            power: Vec::new(),
            angles_rad: [0.0; 2],
            frames_sent: 0,
            syncs_sent: 0,
            synced_rad: 0.0,
        }
    }

    pub fn strike(&mut self, fault: BenchFault) {
        let now = self.clock.now();
        self.advance(now);
        match fault {
            BenchFault::Controller(error) => self.wire.put(now, Received::ControllerError(error)),
            BenchFault::Garbled => self.wire.put(now, Received::Garbled),
            BenchFault::Flood(_) => self.next_flood = Some(now),
            _ => {}
        }
        self.wire.faults.push(fault);
        for device in &mut self.devices {
            device.strike(fault, now, &mut self.wire);
        }
        self.note();
    }

    /// All faults end at a time of the clock.
    pub fn faults_end_at(&mut self, elapsed: Duration) {
        self.faults_end = Some(self.clock.now() + elapsed.saturating_sub(self.clock.elapsed()));
    }

    /// Where the handle is now, as the drive counts it, rad.
    pub fn angle_rad(&self) -> f64 {
        self.devices.iter().find_map(|device| device.motor()).map_or(f64::NAN, |(_, angle_rad)| angle_rad)
    }

    fn note(&mut self) {
        for (powered, angle_rad) in self.devices.iter().filter_map(|device| device.motor()) {
            if self.power.last().is_some_and(|(_, last)| *last) != powered {
                self.power.push((self.clock.now(), powered));
            }
            let [low, high] = self.angles_rad;
            self.angles_rad = [low.min(angle_rad), high.max(angle_rad)];
        }
    }

    fn advance(&mut self, now: Instant) {
        if self.faults_end.is_some_and(|end| end <= now) {
            self.faults_end = None;
            self.wire.faults.clear();
        }
        if let Some((_, stop)) = self.stop_at.as_ref().filter(|(at, _)| *at <= now) {
            stop.store(true, Ordering::Relaxed);
        }
        while let Some(due) = self.next_flood.filter(|due| *due <= now) {
            self.wire.put(due, Received::Frame(Frame::new(0x010, &[0; 8]), Arrival::at(due)));
            let per_s = self.wire.faults.iter().find_map(|fault| match fault {
                BenchFault::Flood(per_s) => Some(*per_s),
                _ => None,
            });
            self.next_flood = per_s.map(|per_s| due + Duration::from_secs(1) / per_s);
        }
        for device in &mut self.devices {
            device.advance(now, &mut self.wire);
        }
        self.note();
        let angle_rad = self.devices.iter().find_map(|device| device.motor()).map(|(_, angle_rad)| angle_rad);
        if let (Some((below_rad, fault)), Some(angle_rad)) = (self.strike_below_rad, angle_rad)
            && angle_rad < below_rad
        {
            self.strike_below_rad = None;
            self.strike(fault);
        }
    }

    /// The shaft of the motor.
    pub fn shaft(&mut self) -> &mut Shaft {
        self.devices.iter_mut().find_map(|device| device.shaft()).expect("the motor has a shaft")
    }

    /// Forgets the highest torque, speed and angles so far.
    pub fn forget(&mut self) {
        let shaft = self.shaft();
        (shaft.highest_torque_nm, shaft.highest_speed_rad_s) = (0.0, 0.0);
        self.angles_rad = [0.0; 2];
    }

    /// Lets the devices go on by themselves until `end`; nobody reads their frames.
    pub fn run_until(&mut self, end: Instant) {
        while let Some(next) = self.next_event().filter(|next| *next <= end) {
            self.clock.advance_to(next);
            let now = self.clock.now();
            self.advance(now);
            self.wire.arriving.retain(|(time, _)| *time > now);
        }
        self.clock.advance_to(end);
    }

    fn next_event(&self) -> Option<Instant> {
        let devices = self.devices.iter().filter_map(|device| device.next_event());
        let arriving = self.wire.arriving.first().map(|(time, _)| *time);
        devices.chain(arriving).chain(self.next_flood).min()
    }
}

/// The master's end of the bus.
#[derive(Debug, Clone)]
pub struct VirtualBus(pub Arc<Mutex<World>>);

impl VirtualBus {
    pub fn world(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap()
    }
}

impl CanBus for VirtualBus {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let mut world = self.world();
        let world = &mut *world;
        if world.wire.has(BenchFault::AdapterGone) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let now = world.clock.now();
        world.advance(now);
        world.frames_sent += 1;
        world.syncs_sent += u64::from(frame.id == 0x080);
        if frame.id == 0x080
            && let Some((_, angle_rad)) = world.devices.iter().find_map(|device| device.motor())
        {
            world.synced_rad = angle_rad;
        }
        if !world.wire.has(BenchFault::Deaf) {
            for device in &mut world.devices {
                device.receive(frame, now, &mut world.wire);
            }
        }
        world.note();
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        let mut world = self.world();
        loop {
            if world.wire.has(BenchFault::AdapterGone) {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            let now = world.clock.now();
            world.advance(now);
            if world.wire.arriving.first().is_some_and(|(time, _)| *time <= now) {
                return Ok(Some(world.wire.arriving.remove(0).1));
            }
            match world.next_event().filter(|next| *next <= deadline) {
                Some(next) => world.clock.advance_to(next.max(now)),
                None => {
                    world.clock.advance_to(deadline);
                    let now = world.clock.now();
                    world.advance(now);
                    return Ok(None);
                }
            }
        }
    }
}
