//! The virtual-time bench: emulated motors on an in-process bus whose clock moves only when the motor's code waits.
//!
//! The code under test is the whole of [`super::CanMotor`]: arming, homing, cycle, checks, safe states. A second of its
//! time takes well under a millisecond, and each run is the same. That the protocols are spoken as others speak them is
//! tested with the independent emulators in `fixtures/can`.
//!
//! ```text
//! world            the bus (CanBus), its devices, frame faults, and what the motor did: power, angle
//! canopen_node     SDO server, NMT and heartbeat that servo_drive and transducer share
//! servo_drive      a CiA 402 drive
//! odrive_axis      an ODrive axis (CANSimple)
//! mit_motor        a motor in MIT mode
//! shaft            inertia, friction and wrist on the shaft of these two
//! transducer       handle torque and EMG of a CANopen sensor
//! other_motors     what shafts of motors without CANopen go through
//! origin_tests     a second process, and the operator's stop while arming
//! obedience_tests  a drive that does not do what it says, or is told
//! arming_tests     what must be known of a drive before it gets power
//! rearm_tests      motors that cannot show their origin, armed again
//! other_program_tests  another program that commands the same motor
//! bench            arms a motor, lets a fault strike, says what became of it
//! ```

mod arming_tests;
mod bench;
mod canopen_node;
mod mit_motor;
mod obedience_tests;
mod odrive_axis;
mod origin_tests;
mod other_motors;
mod other_program_tests;
mod property_tests;
mod rearm_tests;
mod servo_drive;
mod shaft;
mod stop_tests;
mod target_log;
mod tests;
mod transducer;
mod world;
