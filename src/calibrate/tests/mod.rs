//! Tests of the calibration with a rig that is simulated in another way.

mod simulator;
