//! What is so right now: the picture that pages draw, made anew some hundred times a second.

use std::time::Instant;

use serde::Serialize;

use crate::rig::Direction;
use crate::session::{Phase, Status};

/// What the person is shown. It says nothing that a person must not know, such as how fast the ramp will be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SubjectView {
    /// Number of the picture.
    pub n: u64,
    /// What is asked.
    pub cue: Instruction,
    /// Which way to push.
    pub direction: Option<Direction>,
    /// The torque: a fraction of the target, or of a strong effort where there is none. Flexion is positive.
    pub level: f64,
    /// Half-width of the band around the target, as a fraction of it.
    pub band_fraction: f64,
    /// EMG of flexor and extensor, fraction of MVC.
    pub emg_mvc: [f64; 2],
    /// How much of the gate's time has been held, 0 to 1.
    pub gate: f64,
    /// Rest left, s.
    pub rest_left_s: Option<f64>,
    /// The whole rest, s.
    pub rest_s: Option<f64>,
    /// Trials that count.
    pub done: usize,
    /// Trials that are to count in the end.
    pub total: usize,
    /// Whether the last trial counts; absent before the first.
    pub last_counts: Option<bool>,
}

/// What is asked of the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Instruction {
    /// The session has not begun, or was ended.
    Wait,
    /// Let go.
    Relax,
    /// As hard as possible.
    Effort,
    /// Rest.
    Rest,
    /// Bring the bar to the target.
    Target,
    /// The gate is open: stay.
    Stay,
    /// The motor is moving.
    Moving,
    /// A break.
    Pause,
    /// It is done.
    Done,
}

/// All that is so right now; the person is shown a part of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapshot {
    /// What the person is shown.
    #[serde(flatten)]
    pub shown: SubjectView,
    /// Time since the session was started or resumed, s.
    pub t_s: f64,
    /// The phase.
    pub phase: Phase,
    /// Time in it, s.
    pub in_phase_s: f64,
    /// Motor angle, rad.
    pub angle_rad: f64,
    /// The torque on the display, N m.
    pub torque_nm: f64,
    /// The target, N m.
    pub target_nm: Option<f64>,
    /// The trial under way.
    pub trial: Option<CurrentTrial>,
    /// Words of the operator that are possible.
    pub possible: Vec<&'static str>,
    /// A pause was asked for and is still to come.
    pub pause_asked: bool,
    /// Steps that were left out because nobody took them in time.
    pub left_out: u64,
    /// The program is done with the session.
    pub is_over: bool,
    /// When its latest sample was measured.
    #[serde(skip)]
    pub measured: Option<Instant>,
    /// The recording that is being played, if it is one.
    pub tape: Option<PlaybackState>,
}

/// A trial under way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurrentTrial {
    /// Its number.
    pub number: u32,
    /// For practice.
    pub practice: bool,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Which repetition.
    pub repetition: u32,
    /// What became of it, if it is over.
    pub status: Option<Status>,
}

/// How a recording is played.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaybackState {
    /// So many times as fast as it was.
    pub speed: f64,
    /// It is running.
    pub is_playing: bool,
    /// Its length, s.
    pub length_s: f64,
}
