//! A motor's shaft with a wrist on it: what a motor without CANopen really turns.

use std::time::{Duration, Instant};

/// Step of the integration.
const STEP: Duration = Duration::from_micros(100);
/// A muscle at its tone, with the inertia of hand and rotor.
const INERTIA_KG_M2: f64 = 0.0035;
const DAMPING_NM_S_PER_RAD: f64 = 0.25;
const STIFFNESS_NM_PER_RAD: f64 = 20.0;

/// Angle, speed and torque of a shaft at the handle.
#[derive(Debug, Clone)]
pub struct Shaft {
    pub angle_rad: f64,
    pub speed_rad_s: f64,
    /// Torque of the motor.
    pub torque_nm: f64,
    /// Dry friction of the gear, N m.
    pub friction_nm: f64,
    /// Nothing moves it.
    pub is_jammed: bool,
    /// Where the wrist rests.
    rest_rad: f64,
    /// Highest speed and motor torque since they were last forgotten.
    pub highest_speed_rad_s: f64,
    pub highest_torque_nm: f64,
    updated: Instant,
}

impl Shaft {
    pub fn new(angle_rad: f64, now: Instant) -> Self {
        Self {
            angle_rad,
            speed_rad_s: 0.0,
            torque_nm: 0.0,
            friction_nm: 0.0,
            is_jammed: false,
            rest_rad: angle_rad,
            highest_speed_rad_s: 0.0,
            highest_torque_nm: 0.0,
            updated: now,
        }
    }

    /// Moves on to `now`; `motor` gives the torque at an angle and a speed, and how long the step is.
    pub fn advance(&mut self, now: Instant, mut motor: impl FnMut(f64, f64, f64) -> f64) {
        while self.updated < now {
            let step = STEP.min(now - self.updated);
            self.updated += step;
            let dt_s = step.as_secs_f64();
            self.torque_nm = motor(self.angle_rad, self.speed_rad_s, dt_s);
            if self.is_jammed {
                self.speed_rad_s = 0.0;
            } else {
                self.turn(dt_s);
            }
            self.highest_torque_nm = self.highest_torque_nm.max(self.torque_nm.abs());
            self.highest_speed_rad_s = self.highest_speed_rad_s.max(self.speed_rad_s.abs());
        }
    }

    fn turn(&mut self, dt_s: f64) {
        let spring_nm = STIFFNESS_NM_PER_RAD * (self.rest_rad - self.angle_rad);
        let pushed_nm = self.torque_nm + spring_nm - DAMPING_NM_S_PER_RAD * self.speed_rad_s;
        let free_rad_s = self.speed_rad_s + pushed_nm / INERTIA_KG_M2 * dt_s;
        // Dry friction takes away speed, and never more than there is.
        let held_rad_s = self.friction_nm / INERTIA_KG_M2 * dt_s;
        self.speed_rad_s = free_rad_s - free_rad_s.clamp(-held_rad_s, held_rad_s);
        self.angle_rad += self.speed_rad_s * dt_s;
    }
}
