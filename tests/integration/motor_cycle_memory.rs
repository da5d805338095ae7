//! The cycle of the CAN motor asks for no memory: an allocator counts what its thread asks for, on a bus that answers
//! like a drive.

#![cfg(unix)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Instant;

use ramphold::protocol::ValidProtocol;
use ramphold::rig::can::bus::{Arrival, CanBus, Frame, Received};
use ramphold::rig::can::file::ValidRigFile;
use ramphold::rig::can::{CanMotor, Connection, DryRun};
use ramphold::rig::{Armed, ArmingConsent, Command, Cue, Motor, Rig};
use ramphold::timing::SystemClock;

thread_local! {
    static ASKED: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: hands everything to the system's allocator; the count is a plain thread-local number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ASKED.with(|asked| asked.set(asked.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ASKED.with(|asked| asked.set(asked.get() + 1));
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// A bus with one drive that takes what it is told and is where it is sent. Made for this test; that the protocol is
/// spoken right is tried on the emulator in fixtures/can.
#[derive(Debug, Default)]
struct ObedientDrive {
    objects: Vec<((u16, u8), [u8; 4])>,
    answers: VecDeque<Frame>,
    controlword: u16,
    target: i32,
    reached: i32,
    counter: u16,
    beats: u32,
}

const NODE: u16 = 5;

impl ObedientDrive {
    fn new() -> Self {
        let mut drive = Self { answers: VecDeque::with_capacity(64), ..Self::default() };
        for (index, sub, value) in [
            (0x1018, 1, 0xCAFEu32),
            (0x1018, 2, 0x402),
            (0x608F, 1, 131_072),
            (0x608F, 2, 1),
            (0x6076, 0, 10_000),
        ] {
            drive.objects.push(((index, sub), value.to_le_bytes()));
        }
        drive
    }

    fn status(&self) -> u16 {
        let state = match self.controlword & 0x8F {
            0x06 => 0x21,
            0x07 => 0x23,
            0x0F => 0x27,
            _ => 0x40,
        };
        state | 0x1600
    }

    fn object(&mut self, index: u16, sub: u8) -> [u8; 4] {
        match (index, sub) {
            (0x6041, 0) => u32::from(self.status()).to_le_bytes(),
            (0x6064, 0) => self.reached.to_le_bytes(),
            (0x6061, 0) => self.object(0x6060, 0),
            _ => self
                .objects
                .iter()
                .find(|(object, _)| *object == (index, sub))
                .map_or([0; 4], |(_, value)| *value),
        }
    }

    fn sdo(&mut self, data: &[u8]) {
        let (index, sub) = (u16::from_le_bytes([data[1], data[2]]), data[3]);
        let mut answer = [0u8; 8];
        answer[1..4].copy_from_slice(&data[1..4]);
        if data[0] == 0x40 {
            answer[0] = 0x43;
            answer[4..].copy_from_slice(&self.object(index, sub));
        } else if data[0] & 0xE0 == 0x20 {
            answer[0] = 0x60;
            let value = [data[4], data[5], data[6], data[7]];
            if index == 0x6040 {
                self.controlword = u16::from_le_bytes([value[0], value[1]]);
            }
            match self.objects.iter_mut().find(|(object, _)| *object == (index, sub)) {
                Some((_, old)) => *old = value,
                None => self.objects.push(((index, sub), value)),
            }
        } else {
            return;
        }
        self.answers.push_back(Frame::new(0x580 + NODE, &answer));
    }

    fn sync(&mut self) {
        let [p0, p1, p2, p3] = self.reached.to_le_bytes();
        let [s0, s1] = self.status().to_le_bytes();
        self.counter = self.counter.wrapping_add(1);
        let [c0, c1] = self.counter.to_le_bytes();
        self.answers.push_back(Frame::new(0x180 + NODE, &[s0, s1, p0, p1, p2, p3, c0, 0]));
        self.answers.push_back(Frame::new(0x280 + NODE, &[c0, c1, c0, 0, c0, 0]));
        self.reached = self.target;
    }
}

impl CanBus for ObedientDrive {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let data = frame.data();
        match frame.id {
            0x000 if data[0] == 1 => self.answers.push_back(Frame::new(0x700 + NODE, &[5])),
            0x080 => self.sync(),
            0x605 => self.sdo(data),
            0x205 => {
                self.controlword = u16::from_le_bytes([data[0], data[1]]);
                self.target = i32::from_le_bytes([data[2], data[3], data[4], data[5]]);
            }
            0x701 => {
                self.beats += 1;
                self.answers.push_back(Frame::new(0x700 + NODE, &[5]));
            }
            _ => {}
        }
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        if let Some(frame) = self.answers.pop_front() {
            return Ok(Some(Received::Frame(frame, Arrival::at(Instant::now()))));
        }
        while Instant::now() < deadline {
            std::thread::yield_now();
        }
        Ok(None)
    }
}

#[test]
fn a_session_of_cycles_asks_for_no_memory() {
    let rig = include_str!("../../fixtures/can/rigs/plain.json")
        .replace("\"bench\": { \"time_stretch\": 4 }", "\"bench\": null")
        .replace("wait_ms\": 2000", "wait_ms\": 1000")
        .replace("motor_waits_ms\": 2000", "motor_waits_ms\": 1000")
        // A busy test machine may be late, and then the handle seems fast; whether it is, is no affair of this test.
        .replace("\"speed_rad_s\": 5,", "\"speed_rad_s\": 50,")
        .replace("\"missed_cycles_in_a_row\": 400", "\"missed_cycles_in_a_row\": 500")
        .replace("\"unchanged_torque_periods\": 50", "\"unchanged_torque_periods\": 500");
    let rig = ValidRigFile::parse(&rig, "plain.json").unwrap();
    let protocol = include_str!("../../fixtures/can/rigs/one-trial.json")
        .replace("\"speed_rad_s\": 4", "\"speed_rad_s\": 50");
    let protocol = ValidProtocol::parse(&protocol, "one-trial.json").unwrap();
    let dry_run = DryRun::of(&protocol, &rig).unwrap();
    let motor = CanMotor::new(
        Connection::on(Box::new(ObedientDrive::new()), Arc::new(SystemClock::default()), rig),
        dry_run,
    );
    let mut armed = motor.arm(ArmingConsent::given(), &protocol.limits).map_err(|(_, fault)| fault).unwrap();

    let movement = protocol.ramp_and_hold(2.6).unwrap();
    let asked_before = ASKED.with(Cell::get);
    let mut farthest_rad = 0.0f64;
    for period in 0..800u32 {
        let angle_rad = movement.at((f64::from(period) - 50.0) * 0.002).angle_rad;
        let command = Command { motor: Motor::Follow { angle_rad }, cue: Cue::Moving };
        farthest_rad = farthest_rad.max(armed.exchange(&command).unwrap().theta_m_rad);
    }
    assert_eq!(ASKED.with(Cell::get) - asked_before, 0, "allocations in 800 cycles");
    assert!((farthest_rad - 0.14).abs() < 1e-4, "the drive was where it was sent: {farthest_rad}");
    let motor = armed.disarm();
    assert!(motor.summary().periods >= 800 && motor.summary().faults.is_empty(), "{}", motor.summary());
}
