//! Snapshot of a session: what the pages draw, renewed up to 250 times a second.

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use crate::rig::Direction;
use crate::session::{Phase, Status};

/// The part of the snapshot that the subject may see. It must not tell what comes, such as the velocity of the ramp.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SubjectView {
    /// Number of the snapshot.
    pub n: u64,
    /// Instruction to the subject.
    #[serde(rename = "cue")]
    pub instruction: Instruction,
    /// Direction in which the subject pushes.
    pub direction: Option<Direction>,
    /// Torque as a fraction of the target, or of a strong effort where there is no target. Flexion is positive.
    pub level: f64,
    /// Half-width of the band around the target, as a fraction of the target.
    pub band_fraction: f64,
    /// EMG of flexor and extensor, fraction of MVC; `None` where it is not measured.
    pub emg_mvc: [Option<f64>; 2],
    /// Fraction of the gate's time that the torque has been in the band, 0 to 1.
    pub gate: f64,
    /// Remaining rest, s.
    pub rest_left_s: Option<f64>,
    /// Duration of the whole rest, s.
    pub rest_s: Option<f64>,
    /// Number of trials of status ok.
    pub done: usize,
    /// Number of trials of status ok at the end of the session.
    pub total: usize,
    /// Whether the last trial is of status ok; `None` before the first trial has ended.
    pub last_counts: Option<bool>,
}

/// Instruction to the subject.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Instruction {
    /// Wait: the session has not begun, or was ended.
    Wait,
    /// Relax the hand.
    Relax,
    /// Push as hard as possible.
    Effort,
    /// Rest.
    Rest,
    /// Bring the bar to the target.
    Target,
    /// Hold the torque: the gate is open.
    Stay,
    /// The motor is moving.
    Moving,
    /// The session is paused.
    Pause,
    /// All trials are done.
    Done,
}

/// State of the session at one time, as the operator sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapshot {
    /// The part that the subject sees.
    #[serde(flatten)]
    pub subject: SubjectView,
    /// Time since the session was started or resumed, s.
    pub t_s: f64,
    /// Phase of the session.
    pub phase: Phase,
    /// Time in the phase, s.
    pub in_phase_s: f64,
    /// Motor angle, rad.
    pub angle_rad: f64,
    /// Smoothed torque without the offset, N m.
    pub torque_nm: f64,
    /// Target torque, N m.
    pub target_nm: Option<f64>,
    /// Trial under way, or the last one.
    pub trial: Option<CurrentTrial>,
    /// The rig trials; `None` once the subject is seated, and without any in the protocol.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rig_trials: Option<RigTrialsView>,
    /// Expected time to the end of the session without pauses, s; `None` once it is over.
    pub time_left_s: Option<f64>,
    /// Names of the commands that are possible.
    pub possible: Vec<&'static str>,
    /// Questions before those of the possible commands that ask one.
    pub questions: BTreeMap<&'static str, String>,
    /// Whether a requested pause is still to come.
    #[serde(rename = "pause_asked")]
    pub pause_requested: bool,
    /// Number of steps that the console missed because the ring was full.
    #[serde(rename = "left_out")]
    pub missed_steps: u64,
    /// Whether the session and its results are complete, or the program has given up.
    pub is_over: bool,
    /// Time at which the latest sample was measured.
    #[serde(skip)]
    pub measured: Option<Instant>,
    /// State of the playback, for a recorded session.
    #[serde(rename = "tape")]
    pub playback: Option<PlaybackState>,
}

impl Snapshot {
    /// The snapshot before the first step.
    pub fn before_start(playback: Option<PlaybackState>) -> Self {
        Self {
            subject: SubjectView {
                n: 0,
                instruction: Instruction::Wait,
                direction: None,
                level: 0.0,
                band_fraction: 0.0,
                emg_mvc: [None; 2],
                gate: 0.0,
                rest_left_s: None,
                rest_s: None,
                done: 0,
                total: 0,
                last_counts: None,
            },
            t_s: 0.0,
            phase: Phase::Ready,
            in_phase_s: 0.0,
            angle_rad: 0.0,
            torque_nm: 0.0,
            target_nm: None,
            trial: None,
            rig_trials: None,
            time_left_s: None,
            possible: Vec::new(),
            questions: BTreeMap::new(),
            pause_requested: false,
            missed_steps: 0,
            is_over: false,
            measured: None,
            playback,
        }
    }
}

/// A trial under way or just ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurrentTrial {
    /// Number of the trial, from 1.
    pub number: u32,
    /// Whether it is a practice trial.
    pub practice: bool,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Repetition index of its condition, from 1.
    pub repetition: u32,
    /// Status of the trial, once it has ended.
    pub status: Option<Status>,
}

/// The rig trials as the operator sees them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RigTrialsView {
    /// Number of rig trials of status ok.
    pub done: usize,
    /// Number of rig trials of status ok when all are done.
    pub total: usize,
    /// The rig trial under way, such as `known_weight, still, 2`.
    pub current: Option<String>,
    /// What the operator is to do before the session goes on, and how to go on then.
    pub instruction: Option<String>,
}

/// State of the playback of a recorded session.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaybackState {
    /// Speed relative to real time.
    pub speed: f64,
    /// Whether the recording runs.
    pub is_playing: bool,
    /// Time in the recording as it is played, s: of a pause only the beginning is.
    pub position_s: f64,
    /// Length of the recording as it is played, s.
    pub length_s: f64,
}
