//! The master's link to the bus: sends its heartbeat, monitors those of the nodes, and sorts what arrives.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::error::CanopenError;
use super::nmt::{NmtCommand, NmtState};
use super::own_commands::OwnCommands;
use super::{cob, emergency};
use crate::rig::can::bus::{Arrival, CanBus, ControllerError, Frame, Received};
use crate::timing::Clock;

/// Nodes that can be watched: a motor and a few sensors.
const MAX_NODES: usize = 4;

/// Frames that are sorted away in one go after the deadline: a bus that is never silent holds nobody up.
const SORTED_AFTER_DEADLINE: usize = 256;

/// Longer than any period: the program was kept from running.
const LONG_ABSENCE: Duration = Duration::from_millis(150);

/// How long a wait may last before the operator's stop is looked for.
const LONGEST_WAIT_UNHEARD: Duration = Duration::from_millis(2);

/// The heartbeat of this program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OwnHeartbeat {
    /// Node id of this program.
    pub node: u8,
    /// How often.
    pub period: Duration,
}

/// A node whose heartbeat is monitored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MonitoredNode {
    /// Which node.
    pub node: u8,
    /// Longest time between two heartbeats.
    pub timeout: Duration,
}

#[derive(Debug, Clone, Copy)]
struct Watched {
    node: MonitoredNode,
    seen: Instant,
    state: Option<NmtState>,
}

/// What is done with emergencies, lost heartbeats and errors of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorPolicy {
    /// They are counted: while a device is configured or stopped.
    Count,
    /// They are faults: while the motor has power.
    Fault,
}

/// What came by, counted since the bus was opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Frames sent.
    pub sent: u64,
    /// Frames received, foreign ones included.
    pub received: u64,
    /// Frames that are no affair of ours.
    pub foreign: u64,
    /// What was no frame.
    pub garbled: u64,
    /// Frames destroyed on the bus or refused by the adapter.
    pub bus_errors: u64,
    /// Controller warnings.
    pub warnings: u64,
    /// Controller error passive.
    pub passive: u64,
    /// Controller off the bus.
    pub bus_off: u64,
    /// Frames lost because nobody took them in time.
    pub overruns: u64,
    /// Emergencies.
    pub emergencies: u64,
}

/// How much trouble is let pass while the motor has power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Tolerance {
    error_frames: u64,
    garbled: u64,
    foreign_per_s: u32,
}

/// The link of a CANopen master to its bus.
#[derive(Debug)]
pub struct Link {
    bus: Box<dyn CanBus>,
    clock: Arc<dyn Clock>,
    beat: Option<(OwnHeartbeat, Instant)>,
    own_commands: OwnCommands,
    watched: [Option<Watched>; MAX_NODES],
    error_policy: ErrorPolicy,
    tolerance: Tolerance,
    /// Counters when the watch began: what was before is no fault.
    before: Counters,
    foreign_window: (Instant, u64),
    /// Nodes whose boot-up message came since it was last asked for, a bit each.
    booted: u128,
    /// Nodes whose position sensor failed since it was last asked for, a bit each.
    sensor_errors: u128,
    /// The latest emergency, for messages.
    last_emergency: Option<(u8, u16)>,
    counters: Counters,
    /// Why the bus was gone when it was first.
    adapter_error: Option<io::Error>,
    time_stretch: f64,
    /// When it was last asked for what came.
    listened: Instant,
    /// When the latest frame arrived.
    arrival: Arrival,
    /// Set by the operator to stop the program.
    stop: Option<Arc<AtomicBool>>,
    /// The operator's stop interrupts whatever waits for frames.
    is_interruptible: bool,
}

impl Link {
    /// Over an open bus; nothing is sent yet.
    pub fn new(bus: Box<dyn CanBus>, clock: Arc<dyn Clock>) -> Self {
        let now = clock.now();
        Self {
            clock,
            bus,
            beat: None,
            own_commands: OwnCommands::default(),
            watched: [None; MAX_NODES],
            error_policy: ErrorPolicy::Count,
            tolerance: Tolerance { error_frames: 0, garbled: 0, foreign_per_s: u32::MAX },
            before: Counters::default(),
            foreign_window: (now, 0),
            booted: 0,
            sensor_errors: 0,
            last_emergency: None,
            counters: Counters::default(),
            adapter_error: None,
            time_stretch: 1.0,
            listened: now,
            arrival: Arrival::at(now),
            stop: None,
            is_interruptible: false,
        }
    }

    /// The clock of the bus.
    pub fn clock(&self) -> &dyn Clock {
        self.clock.as_ref()
    }

    /// The present time.
    pub fn now(&self) -> Instant {
        self.clock.now()
    }

    /// When the latest frame that was received arrived, which may be before it was asked for.
    pub fn arrival(&self) -> Arrival {
        self.arrival
    }

    /// Counts of frames and errors so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Error frames, garbled frames and foreign frames a second that are no fault.
    pub fn tolerate(&mut self, error_frames: u64, garbled: u64, foreign_per_s: u32) {
        self.tolerance = Tolerance { error_frames, garbled, foreign_per_s };
    }

    /// What nobody else may send on this bus.
    pub fn set_own_commands(&mut self, own_commands: OwnCommands) {
        self.own_commands = own_commands;
    }

    /// Everybody may take so many times as long to answer: on the bench, where time is stretched.
    pub fn stretch(&mut self, factor: f64) {
        self.time_stretch = factor;
    }

    /// How many times as long everything takes.
    pub fn time_stretch(&self) -> f64 {
        self.time_stretch
    }

    /// The flag by which the operator stops the program.
    pub fn stop_on(&mut self, stop: Arc<AtomicBool>) {
        self.stop = Some(stop);
    }

    /// From now on, whatever waits for frames ends with [`CanopenError::Interrupted`] when the operator stops the program;
    /// or does not. It does while the motor is being armed, never while it is made safe. After one interruption it does
    /// not any more.
    pub fn set_interruptible(&mut self, is_interruptible: bool) {
        self.is_interruptible = is_interruptible;
    }

    fn listen_to_operator(&mut self) -> Result<(), CanopenError> {
        let stopped = self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed));
        if self.is_interruptible && stopped {
            self.is_interruptible = false;
            return Err(CanopenError::Interrupted);
        }
        Ok(())
    }

    /// Begins to send our heartbeat, or ends it: then every drive that minds it stops by itself.
    pub fn set_own_heartbeat(&mut self, beat: Option<OwnHeartbeat>) {
        self.beat = beat.map(|beat| (beat, self.now()));
    }

    /// Minds the heartbeats of these nodes from now on.
    pub fn watch(&mut self, monitored_nodes: &[MonitoredNode]) {
        self.watched = [None; MAX_NODES];
        let seen = self.now();
        for (slot, node) in self.watched.iter_mut().zip(monitored_nodes) {
            *slot = Some(Watched { node: *node, seen, state: None });
        }
    }

    /// What is a fault from now on.
    pub fn set_error_policy(&mut self, error_policy: ErrorPolicy) {
        self.error_policy = error_policy;
        self.before = self.counters;
        let now = self.now();
        self.foreign_window = (now, self.counters.foreign);
        for watched in self.watched.iter_mut().flatten() {
            watched.seen = now;
        }
    }

    /// What the latest heartbeat of a watched node said.
    pub fn state(&self, node: u8) -> Option<NmtState> {
        self.watched.iter().flatten().find(|watched| watched.node.node == node)?.state
    }

    /// Whether a node was restarted since [`Link::forget_boot_up`]: its boot-up message came, watched or not. One that was lost in a queue
    /// that nobody read is not known of.
    pub fn has_booted(&self, node: u8) -> bool {
        self.booted & 1 << (node & 0x7F) != 0
    }

    /// What a node lost when it was restarted was set again.
    pub fn forget_boot_up(&mut self, node: u8) {
        self.booted &= !(1 << (node & 0x7F));
    }

    /// Whether a watched node has reported an error of a position sensor since [`Link::forget_sensor_error`].
    pub fn has_sensor_error(&self, node: u8) -> bool {
        self.sensor_errors & 1 << (node & 0x7F) != 0
    }

    /// What a node lost with its position sensor is known.
    pub fn forget_sensor_error(&mut self, node: u8) {
        self.sensor_errors &= !(1 << (node & 0x7F));
    }

    /// The latest emergency: node and code.
    pub fn last_emergency(&self) -> Option<(u8, u16)> {
        self.last_emergency
    }

    /// What the adapter or the operating system said when the bus was gone; `None` if it never was.
    pub fn adapter_error(&self) -> Option<&io::Error> {
        self.adapter_error.as_ref()
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// [`CanopenError::BusGone`]
    pub fn send(&mut self, frame: &Frame) -> Result<(), CanopenError> {
        self.bus.send(frame).map_err(|error| gone(&mut self.adapter_error, error))?;
        self.counters.sent += 1;
        Ok(())
    }

    /// Tells a node, or all (0), to change its state.
    ///
    /// # Errors
    /// [`CanopenError::BusGone`]
    pub fn nmt(&mut self, command: NmtCommand, node: u8) -> Result<(), CanopenError> {
        self.send(&Frame::new(cob::NMT, &[command.specifier(), node]))
    }

    /// The next data frame that is neither heartbeat nor emergency, or `None` at the deadline. What has arrived by the deadline
    /// is still taken in after it, so a loop over this must look at the clock if others fill the bus.
    ///
    /// # Errors
    /// While watching: whatever is wrong with nodes and bus. While interruptible: [`CanopenError::Interrupted`].
    pub fn receive(&mut self, deadline: Instant) -> Result<Option<Frame>, CanopenError> {
        let mut sorted_late = 0;
        loop {
            self.listen_to_operator()?;
            let now = self.now();
            self.excuse(now);
            self.beat_if_due(now)?;
            self.check_watched(now)?;
            if sorted_late >= SORTED_AFTER_DEADLINE {
                return Ok(None);
            }
            sorted_late += usize::from(now >= deadline);
            let mut next = self.beat.map_or(deadline, |(_, due)| due.min(deadline));
            if self.is_interruptible {
                next = next.min(now + LONGEST_WAIT_UNHEARD);
            }
            match self.bus.receive(next).map_err(|error| gone(&mut self.adapter_error, error))? {
                Some(received) => {
                    if let Some(frame) = self.sort(received)? {
                        return Ok(Some(frame));
                    }
                }
                None if next >= deadline => return Ok(None),
                None => {}
            }
        }
    }

    /// Throws away what arrived while nobody listened; ends after a while on a bus that is never silent.
    pub fn drain(&mut self) -> Result<(), CanopenError> {
        let end = self.now() + Duration::from_millis(100);
        while self.now() < end {
            match self.bus.receive(self.clock.now()).map_err(|error| gone(&mut self.adapter_error, error))? {
                Some(received) => drop(self.sort(received)?),
                None => break,
            }
        }
        Ok(())
    }

    /// Lets time pass until `end` with heartbeats going both ways; frames are dropped.
    ///
    /// # Errors
    /// While watching: whatever is wrong with nodes and bus.
    pub fn pass_time(&mut self, end: Instant) -> Result<(), CanopenError> {
        while self.receive(end)?.is_some() && self.now() < end {}
        Ok(())
    }

    /// Listens until `end` for another program that commands this bus.
    ///
    /// # Errors
    /// [`CanopenError::OtherMaster`]
    pub fn listen_for_other_master(&mut self, end: Instant) -> Result<(), CanopenError> {
        while let Some(frame) = self.receive(end)? {
            if self.own_commands.contains(&frame) {
                return Err(CanopenError::OtherMaster { id: frame.id });
            }
            if self.now() >= end {
                break;
            }
        }
        Ok(())
    }

    /// A frame that nobody asked for.
    pub fn count_foreign(&mut self) -> Result<(), CanopenError> {
        self.counters.foreign += 1;
        if self.error_policy == ErrorPolicy::Count {
            return Ok(());
        }
        let (since, count) = self.foreign_window;
        let (per_s, tolerated) = ((self.counters.foreign - count) as u32, self.tolerance.foreign_per_s);
        if per_s > tolerated {
            return Err(CanopenError::Flood { per_s, tolerated });
        }
        if self.now().saturating_duration_since(since) >= Duration::from_secs(1) {
            self.foreign_window = (self.now(), self.counters.foreign);
        }
        Ok(())
    }

    fn beat_if_due(&mut self, now: Instant) -> Result<(), CanopenError> {
        if let Some((beat, due)) = self.beat
            && now >= due
        {
            // After a long absence it goes on from now; the drives have noticed by themselves.
            let next = if now > due + beat.period { now } else { due } + beat.period;
            self.beat = Some((beat, next));
            self.send(&Frame::new(cob::HEARTBEAT + u16::from(beat.node), &[5]))?;
        }
        Ok(())
    }

    /// Who was away could hear nobody: silence counts from its return. That it was away is a fault of its own, an overrun.
    fn excuse(&mut self, now: Instant) {
        let away = now.saturating_duration_since(self.listened);
        self.listened = now;
        if away > LONG_ABSENCE {
            self.watched
                .iter_mut()
                .flatten()
                .for_each(|watched| watched.seen = (watched.seen + away).min(now));
        }
    }

    fn check_watched(&self, now: Instant) -> Result<(), CanopenError> {
        if self.error_policy == ErrorPolicy::Count {
            return Ok(());
        }
        for Watched { node, seen, .. } in self.watched.iter().flatten() {
            let silent = now.saturating_duration_since(*seen);
            if silent > node.timeout {
                return Err(CanopenError::HeartbeatLost {
                    node: node.node,
                    after_ms: silent.as_millis() as u64,
                });
            }
        }
        Ok(())
    }

    /// Takes care of what is not for the caller.
    fn sort(&mut self, received: Received) -> Result<Option<Frame>, CanopenError> {
        match received {
            Received::Frame(frame, arrival) => {
                self.counters.received += 1;
                self.arrival = arrival;
                if (0x701..=0x77F).contains(&frame.id) && frame.data() == [0] {
                    self.booted |= 1 << (frame.id & 0x7F);
                }
                if self.error_policy == ErrorPolicy::Fault && self.own_commands.contains(&frame) {
                    return Err(CanopenError::OtherMaster { id: frame.id });
                }
                match frame.id {
                    0x700..=0x77F if self.minds(&frame) => {
                        self.heartbeat(&frame, arrival.latest).map(|()| None)
                    }
                    0x081..=0x0FF if self.minds(&frame) => self.emergency(&frame).map(|()| None),
                    _ => Ok(Some(frame)),
                }
            }
            Received::Foreign => {
                self.counters.received += 1;
                self.count_foreign().map(|()| None)
            }
            Received::Garbled => {
                self.counters.garbled += 1;
                let (count, tolerated) =
                    (self.counters.garbled - self.before.garbled, self.tolerance.garbled);
                if self.error_policy == ErrorPolicy::Fault && count > tolerated {
                    return Err(CanopenError::Garbled { count, tolerated });
                }
                Ok(None)
            }
            Received::ControllerError(trouble) => self.controller_error(trouble).map(|()| None),
        }
    }

    /// Whether a heartbeat or an emergency is that of a watched node.
    fn minds(&self, frame: &Frame) -> bool {
        self.watched.iter().flatten().any(|watched| u16::from(watched.node.node) == frame.id & 0x7F)
    }

    fn heartbeat(&mut self, frame: &Frame, arrived: Instant) -> Result<(), CanopenError> {
        let node = (frame.id & 0x7F) as u8;
        let watching = self.error_policy == ErrorPolicy::Fault;
        let Some(watched) = self.watched.iter_mut().flatten().find(|watched| watched.node.node == node)
        else {
            return Ok(());
        };
        let Some(byte) = frame.data().first() else { return Ok(()) };
        let state = NmtState::from_byte(*byte);
        watched.seen = arrived;
        watched.state = Some(state);
        match state {
            NmtState::BootUp if watching => Err(CanopenError::Rebooted { node }),
            state if watching && state != NmtState::Operational => {
                Err(CanopenError::NotOperational { node, state })
            }
            _ => Ok(()),
        }
    }

    fn emergency(&mut self, frame: &Frame) -> Result<(), CanopenError> {
        let node = (frame.id & 0x7F) as u8;
        let Some((code, register)) = emergency::parse(frame.data()) else { return Ok(()) };
        self.counters.emergencies += 1;
        self.last_emergency = Some((node, code));
        if emergency::is_sensor_error(code) {
            self.sensor_errors |= 1 << node;
        }
        // Code 0 says that an error is gone.
        if self.error_policy == ErrorPolicy::Fault && code != 0 {
            return Err(CanopenError::Emergency { node, code, register });
        }
        Ok(())
    }

    fn controller_error(&mut self, trouble: ControllerError) -> Result<(), CanopenError> {
        let counters = &mut self.counters;
        match trouble {
            ControllerError::BusError => counters.bus_errors += 1,
            ControllerError::Warning => counters.warnings += 1,
            ControllerError::Passive => counters.passive += 1,
            ControllerError::BusOff => counters.bus_off += 1,
            ControllerError::Overrun => counters.overruns += 1,
            ControllerError::Restarted => {}
        }
        if self.error_policy == ErrorPolicy::Count {
            return Ok(());
        }
        let all = |counters: &Counters| {
            counters.bus_errors + counters.warnings + counters.passive + counters.overruns
        };
        let count = all(&self.counters) - all(&self.before);
        match trouble {
            ControllerError::BusOff => Err(CanopenError::BusOff),
            ControllerError::Restarted => Ok(()),
            // A passive controller may be deaf to errors, an overrun has lost frames: never tolerated.
            ControllerError::Passive | ControllerError::Overrun => {
                Err(CanopenError::ControllerError { trouble, count })
            }
            _ if count > self.tolerance.error_frames => Err(CanopenError::ControllerError { trouble, count }),
            _ => Ok(()),
        }
    }
}

/// Keeps why the bus was gone when it was first.
fn gone(kept: &mut Option<io::Error>, error: io::Error) -> CanopenError {
    kept.get_or_insert(error);
    CanopenError::BusGone
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::can::canopen::Object;
    use crate::timing::SystemClock;

    /// A bus on which something arrives whenever it is asked.
    #[derive(Debug)]
    struct NeverSilent(Received);

    impl CanBus for NeverSilent {
        fn send(&mut self, _: &Frame) -> std::io::Result<()> {
            Ok(())
        }

        fn receive(&mut self, _: Instant) -> std::io::Result<Option<Received>> {
            Ok(Some(self.0))
        }
    }

    /// A bus whose adapter cannot be used.
    #[derive(Debug)]
    struct Broken;

    impl CanBus for Broken {
        fn send(&mut self, _: &Frame) -> io::Result<()> {
            Err(io::Error::other("the adapter takes no bytes"))
        }

        fn receive(&mut self, _: Instant) -> io::Result<Option<Received>> {
            Err(io::Error::other("later"))
        }
    }

    #[test]
    fn what_the_adapter_said_first_when_the_bus_was_gone_is_kept() {
        let mut link = Link::new(Box::new(Broken), Arc::new(SystemClock::default()));
        assert!(link.adapter_error().is_none());
        assert!(matches!(link.nmt(NmtCommand::Stop, 5), Err(CanopenError::BusGone)));
        assert!(matches!(link.drain(), Err(CanopenError::BusGone)));
        assert_eq!(link.adapter_error().unwrap().to_string(), "the adapter takes no bytes");
    }

    #[test]
    fn a_bus_that_is_never_silent_holds_up_neither_a_wait_nor_a_question() {
        let foreign = Received::Frame(Frame::new(0x010, &[]), Arrival::at(Instant::now()));
        for received in [Received::Garbled, Received::Foreign, foreign] {
            let mut link = Link::new(Box::new(NeverSilent(received)), Arc::new(SystemClock::default()));
            let began = Instant::now();
            link.pass_time(began + Duration::from_millis(10)).unwrap();
            assert!(began.elapsed() < Duration::from_millis(500), "{received:?}: {:?}", began.elapsed());
            let silent = link.read(5, Object::plain(0x6041)).unwrap_err();
            assert!(matches!(silent, CanopenError::SdoSilent { .. }), "{received:?}: {silent}");
            assert!(began.elapsed() < Duration::from_secs(5), "{received:?}: {:?}", began.elapsed());
        }
    }
}
