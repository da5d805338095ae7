//! Aligns a recording with the trials of a session.

use std::path::{Path, PathBuf};

use super::attachment::{self, ATTACHED, Attachment, AttachmentTrial, ClockComparison, LeftOut};
use super::correlation::{Sampled, SearchedRecording};
use super::error::AttachError;
use super::event_match::{EventCandidate, MatchProblem, match_events};
use super::trigger;
use crate::dataset::{self, PROGRAM, RampTime, Record, Session, Trial};
use crate::files::{self, limits};
use crate::import::{Recording, SourceTable, TIME_COLUMN, read_recording};

/// A step longer than this many usual ones is a gap.
const GAP_STEPS: f64 = 1.5;

/// The most places of a trial by a shared signal: as many as a session has trials of one condition, and more.
const MOST_PLACES: usize = 200;

/// How a recording says when its samples were taken.
#[derive(Debug, Clone, PartialEq)]
pub enum ClockSource {
    /// By its format, as EDF and XDF.
    Format,
    /// By a column, in seconds.
    Column(String),
    /// By the rate of its samples, Hz.
    Rate(f64),
}

/// What recording and session have in common.
#[derive(Debug, Clone, PartialEq)]
pub enum Reference {
    /// A column with a pulse at the beginning of each ramp.
    Trigger {
        /// The column.
        column: String,
        /// Level that the pulse crosses; found if not given.
        threshold: Option<f64>,
        /// Whether the pulse begins downwards.
        falling: bool,
    },
    /// Markers with this text, or with this text and the number of the trial.
    Marker(String),
    /// A column with a signal of the session.
    Signal {
        /// The column of the recording.
        column: String,
        /// The column of the trials: `theta_m_rad`, `torque_l_nm`, `emg_fcr_mvc` or `emg_ecr_mvc`.
        shared: String,
    },
}

/// A recording and how it is to be attached.
#[derive(Debug, Clone)]
pub struct AttachRequest {
    /// The session's folder.
    pub session: PathBuf,
    /// The recording.
    pub file: PathBuf,
    /// Its clock.
    pub clock: ClockSource,
    /// What it has in common with the session.
    pub reference: Reference,
    /// Part of the name of the table or stream to attach, where the recording has several.
    pub table: Option<String>,
    /// Columns of the EMG of flexor and extensor carpi radialis.
    pub emg: [Option<String>; 2],
    /// Mean rectified EMG of flexor and extensor at maximal effort, in the unit of their columns.
    pub emg_at_mvc: [Option<f64>; 2],
    /// Name of the attachment; that of the file without its ending if not given.
    pub name: Option<String>,
}

/// A recording that was aligned, before it is written.
#[derive(Debug, Clone)]
pub struct Aligned {
    /// What is known of it.
    pub attachment: Attachment,
    session: PathBuf,
    name: String,
    files: Vec<(String, Vec<u8>)>,
}

impl Aligned {
    /// Folder of the attachment.
    pub fn folder(&self) -> PathBuf {
        self.session.join(ATTACHED).join(&self.name)
    }

    /// Writes it beside the session's raw data.
    ///
    /// # Errors
    /// If an attachment of that name is there, or the folder cannot be written.
    pub fn write(&self) -> Result<(), AttachError> {
        if files::exists(&self.folder()) {
            return Err(AttachError::Exists(self.folder()));
        }
        attachment::write(&self.session, &self.name, &self.files, &self.attachment)
    }
}

/// Aligns a recording with a session. Nothing is written.
///
/// # Errors
/// If session or recording cannot be read, the recording's clock is not sound, or the ramps of the session cannot be found in it.
pub fn align(request: &AttachRequest) -> Result<Aligned, AttachError> {
    let name = name(request)?;
    let folder = request.session.join(ATTACHED).join(&name);
    if files::exists(&folder) {
        return Err(AttachError::Exists(folder));
    }
    let session = dataset::load(&request.session)?;
    let recording = read_recording(&request.file)?;
    let table = TimedTable::new(request, &recording)?;
    for column in request.emg.iter().flatten() {
        table.column(column)?;
    }
    // Without a journal nobody knows when the ramps were; their order is known.
    let ramps = dataset::ramp_times(&request.session)?.unwrap_or_default();
    let found = match &request.reference {
        Reference::Trigger { column, threshold, falling } => {
            let times_s = edges_in(request, &recording, column, *threshold, *falling)?;
            at_events(request, &session, &ramps, &times_s, &table)?
        }
        Reference::Marker(text) => at_markers(request, &session, &ramps, &recording, text, &table)?,
        Reference::Signal { column, shared } => by_signal(request, &session, &ramps, &table, column, shared)?,
    };
    let bytes = files::read(&request.file, limits::RECORDING_BYTES)
        .map_err(|source| crate::import::ImportError::Unreadable { path: request.file.clone(), source })?;
    Ok(cut(request, name, &session, &table, found, bytes))
}

fn unexpected(request: &AttachRequest, found: String, expected: impl Into<String>) -> AttachError {
    AttachError::Unexpected { file: request.file.clone(), found, expected: expected.into() }
}

fn not_aligned(request: &AttachRequest, reason: String) -> AttachError {
    AttachError::NotAligned { file: request.file.clone(), reason }
}

fn name(request: &AttachRequest) -> Result<String, AttachError> {
    let stem = request.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = request.name.clone().unwrap_or(stem);
    let is_good = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if name.is_empty() || name.starts_with('.') || !name.chars().all(is_good) {
        return Err(unexpected(
            request,
            format!("the name {name:?}"),
            "a name of letters, digits, -, _ and . for the attachment; give --name",
        ));
    }
    Ok(name)
}

/// The table that is attached, with the times of its samples.
struct TimedTable<'a> {
    request: &'a AttachRequest,
    table: &'a SourceTable,
    times_s: Vec<f64>,
    rate_hz: f64,
    /// Samples after which a gap begins.
    gaps: Vec<usize>,
}

impl<'a> TimedTable<'a> {
    fn new(request: &'a AttachRequest, recording: &'a Recording) -> Result<Self, AttachError> {
        let is_wanted =
            |table: &&SourceTable| request.table.as_ref().is_none_or(|part| table.name.contains(part));
        let wanted: Vec<&SourceTable> = recording.tables.iter().filter(is_wanted).collect();
        let [table] = wanted.as_slice() else {
            let names: Vec<&str> = recording.tables.iter().map(|table| table.name.as_str()).collect();
            let found = format!("{} tables or streams ({})", wanted.len(), names.join("; "));
            return Err(unexpected(request, found, "one; name it with --table"));
        };
        let times_s = times(request, table)?;
        if times_s.len() < 2 {
            return Err(unexpected(
                request,
                format!("{} samples", times_s.len()),
                "a recording of the session",
            ));
        }
        let rate_hz = (times_s.len() - 1) as f64 / (times_s[times_s.len() - 1] - times_s[0]);
        let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let usual_s = {
            let middle = steps.len() / 2;
            *steps.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        let is_gap = |pair: &[f64]| pair[1] - pair[0] > GAP_STEPS * usual_s;
        let gaps =
            times_s.windows(2).enumerate().filter(|(_, pair)| is_gap(pair)).map(|(at, _)| at).collect();
        Ok(Self { request, table, times_s, rate_hz, gaps })
    }

    fn column(&self, name: &str) -> Result<&'a [f64], AttachError> {
        self.table.column(name).ok_or_else(|| {
            let found = format!("no column {name:?} in {}", self.table.name);
            unexpected(self.request, found, format!("one of {}", self.table.names()))
        })
    }

    fn length_s(&self) -> f64 {
        self.times_s[self.times_s.len() - 1] - self.times_s[0]
    }

    /// The columns that are attached: all but that of time.
    fn columns(&self) -> Vec<&'a (String, Vec<f64>)> {
        let time = match &self.request.clock {
            ClockSource::Column(column) => column.as_str(),
            _ => TIME_COLUMN,
        };
        self.table.columns.iter().filter(|(name, _)| name != time).collect()
    }
}

/// Times of the samples of a table, which must go on.
fn times(request: &AttachRequest, table: &SourceTable) -> Result<Vec<f64>, AttachError> {
    let samples = table.columns.first().map_or(0, |(_, values)| values.len());
    let column = match &request.clock {
        ClockSource::Rate(rate_hz) => {
            return Ok((0..samples).map(|sample| sample as f64 / rate_hz).collect());
        }
        ClockSource::Column(column) => column.as_str(),
        ClockSource::Format => TIME_COLUMN,
    };
    let Some(times_s) = table.column(column) else {
        let found = format!("no column {column:?} in {}", table.name);
        let expected =
            format!("a column of time in seconds (--time) or the rate (--rate); there are {}", table.names());
        return Err(unexpected(request, found, expected));
    };
    let stops = |pair: &[f64]| pair[0].partial_cmp(&pair[1]).is_none_or(|order| order.is_ge());
    if let Some(at) = times_s.windows(2).position(stops) {
        let found =
            format!("{} s after {} s in sample {} of {}", times_s[at + 1], times_s[at], at + 2, table.name);
        return Err(unexpected(request, found, "times that go on; did the clock jump?"));
    }
    Ok(times_s.to_vec())
}

/// The edges of a trigger, which may be in another table of the recording.
fn edges_in(
    request: &AttachRequest,
    recording: &Recording,
    column: &str,
    threshold: Option<f64>,
    falling: bool,
) -> Result<Vec<f64>, AttachError> {
    let Some(table) = recording.tables.iter().find(|table| table.column(column).is_some()) else {
        let names: Vec<String> = recording.tables.iter().map(SourceTable::names).collect();
        return Err(unexpected(
            request,
            format!("no column {column:?}"),
            format!("one of {}", names.join(", ")),
        ));
    };
    let values = table.column(column).unwrap_or_default();
    let times_s = times(request, table)?;
    let threshold = threshold.unwrap_or_else(|| trigger::middle(values));
    Ok(trigger::edges(&times_s, values, threshold, falling))
}

/// A trial that was found: its number, when its ramp began on the clock of the recording, and its correlation.
#[derive(Debug, Clone, Copy)]
struct AlignedRamp {
    trial: u32,
    onset_s: f64,
    residual_s: Option<f64>,
}

/// What was found of all trials.
#[derive(Debug, Default)]
struct AlignedRamps {
    by: String,
    trials: Vec<AlignedRamp>,
    clock: ClockComparison,
    /// Rate of the recording's clock over that of the session, where known.
    speed: Option<f64>,
}

/// Trials at events, of which the session has one at each ramp.
fn at_events(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    times_s: &[f64],
    table: &TimedTable,
) -> Result<AlignedRamps, AttachError> {
    let by = match &request.reference {
        Reference::Trigger { column, .. } => format!("trigger, column {column}"),
        Reference::Marker(text) => format!("marker {text:?}"),
        Reference::Signal { .. } => String::new(),
    };
    if ramps.is_empty() {
        return in_order(request, session, times_s, by);
    }
    let most = 10 * ramps.len() + 100;
    if times_s.len() > most {
        return Err(not_aligned(
            request,
            format!(
                "{} pulses for {} ramps; set --threshold between the two levels of the trigger, or name another column",
                times_s.len(),
                ramps.len()
            ),
        ));
    }
    let candidates: Vec<EventCandidate> =
        times_s.iter().map(|time_s| EventCandidate { time_s: *time_s, weight: 1.0 }).collect();
    let grain_s = 2.0 / table.rate_hz;
    matched(request, ramps, |_| candidates.as_slice(), (grain_s, table.length_s()), by, |_, own| own)
}

/// Trials of a session whose times nobody knows: as many events as ramps, in order.
fn in_order(
    request: &AttachRequest,
    session: &Session,
    times_s: &[f64],
    by: String,
) -> Result<AlignedRamps, AttachError> {
    let trials: Vec<&Trial> = session.trials.iter().filter(|trial| trial.onset_s.is_some()).collect();
    if trials.len() != times_s.len() {
        return Err(not_aligned(
            request,
            format!(
                "{} events for {} trials with an onset; a session without a journal has no times to tell them apart by, so there must be \
                 one for each: set --threshold, or cut the recording",
                times_s.len(),
                trials.len()
            ),
        ));
    }
    let found = trials.iter().zip(times_s);
    let trials =
        found.map(|(trial, time_s)| AlignedRamp { trial: trial.number, onset_s: *time_s, residual_s: None });
    Ok(AlignedRamps { by, trials: trials.collect(), ..AlignedRamps::default() })
}

/// Trials at markers: those with a number are of that trial, the others are matched by their times.
fn at_markers(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    recording: &Recording,
    text: &str,
    table: &TimedTable,
) -> Result<AlignedRamps, AttachError> {
    let numbered: Vec<(u32, f64)> = recording
        .markers
        .iter()
        .filter_map(|marker| Some((marker.text.strip_prefix(text)?.trim().parse().ok()?, marker.time_s)))
        .collect();
    if numbered.is_empty() {
        let mut times_s: Vec<f64> = recording
            .markers
            .iter()
            .filter(|marker| marker.text.trim() == text)
            .map(|marker| marker.time_s)
            .collect();
        times_s.sort_by(f64::total_cmp);
        if times_s.is_empty() {
            let mut texts: Vec<&str> = recording.markers.iter().map(|marker| marker.text.as_str()).collect();
            texts.sort_unstable();
            texts.dedup();
            texts.truncate(10);
            return Err(not_aligned(
                request,
                format!("no marker {text:?}; its markers are {texts:?}: name one with --marker"),
            ));
        }
        return at_events(request, session, ramps, &times_s, table);
    }
    let mut found =
        AlignedRamps { by: format!("marker {text:?} with the trial's number"), ..AlignedRamps::default() };
    for trial in &session.trials {
        let own: Vec<f64> = numbered
            .iter()
            .filter(|(number, _)| *number == trial.number)
            .map(|(_, time_s)| *time_s)
            .collect();
        match own.as_slice() {
            [] => {}
            [time_s] => {
                found.trials.push(AlignedRamp { trial: trial.number, onset_s: *time_s, residual_s: None });
            }
            several => {
                let reason = format!("{} markers of trial {}; expected one", several.len(), trial.number);
                return Err(not_aligned(request, reason));
            }
        }
    }
    if found.trials.is_empty() {
        let reason = format!("its markers {text:?} are of none of the session's trials");
        return Err(not_aligned(request, reason));
    }
    let pairs: Vec<(usize, f64, f64)> = found
        .trials
        .iter()
        .map(|own| {
            let ramp = ramps.iter().find(|ramp| ramp.trial == Some(own.trial));
            ramp.map_or((usize::MAX, 0.0, own.onset_s), |ramp| (ramp.stretch, ramp.onset_s, own.onset_s))
        })
        .collect();
    found.compare_clocks(&pairs);
    Ok(found)
}

/// Trials by a signal that the recording shares with them.
fn by_signal(
    request: &AttachRequest,
    session: &Session,
    ramps: &[RampTime],
    table: &TimedTable,
    column: &str,
    shared: &str,
) -> Result<AlignedRamps, AttachError> {
    if ramps.is_empty() {
        let reason = "ramps of one condition look alike, and a session without a journal has no times to tell them apart by; use a \
                      trigger or markers";
        return Err(not_aligned(request, reason.to_owned()));
    }
    let of_record: fn(&Record) -> Option<&Vec<f64>> = match shared {
        "theta_m_rad" => |record| Some(&record.theta_m_rad),
        "torque_l_nm" => |record| Some(&record.torque_l_nm),
        "emg_fcr_mvc" => |record| record.emg_fcr_mvc.as_ref(),
        "emg_ecr_mvc" => |record| record.emg_ecr_mvc.as_ref(),
        other => {
            let found = format!("--shared {other}");
            let expected = "theta_m_rad, torque_l_nm, emg_fcr_mvc or emg_ecr_mvc";
            return Err(unexpected(request, found, expected));
        }
    };
    let values = table.column(column)?;
    if let Some(gap) = table.gaps.first() {
        let found = format!("a gap after {} s", table.times_s[*gap]);
        return Err(unexpected(
            request,
            found,
            "samples at equal steps to correlate; use a trigger or markers",
        ));
    }
    let whole = Sampled { start_s: table.times_s[0], rate_hz: table.rate_hz, values };
    let mut searched = SearchedRecording::new(whole);
    let trial_of = |ramp: &RampTime| {
        let trial = session.trials.iter().find(|trial| Some(trial.number) == ramp.trial)?;
        let onset_s = trial.onset_s?;
        let values = of_record(&trial.record)?;
        // Time 0 is the onset.
        let start_s = trial.record.start_s - onset_s;
        Some(Sampled { start_s, rate_hz: session.sample_rate_hz, values })
    };
    let known: Vec<(RampTime, Sampled)> =
        ramps.iter().filter_map(|ramp| Some((*ramp, trial_of(ramp)?))).collect();
    if known.is_empty() {
        return Err(not_aligned(request, format!("no trial of the session has {shared} and an onset")));
    }
    // Trials of one condition look alike: each may fit at the places of the others.
    let most = known.len().min(MOST_PLACES);
    let places: Vec<Vec<EventCandidate>> =
        known.iter().map(|(_, trial)| searched.places(*trial, most)).collect();
    let ramps: Vec<RampTime> = known.iter().map(|(ramp, _)| *ramp).collect();
    let by = format!("correlation of {column} with {shared}");
    let grain_s = 0.01;
    let length_s = table.length_s();
    matched(
        request,
        &ramps,
        |at| places[at].as_slice(),
        (grain_s, length_s),
        by,
        |at, own| searched.refined(known[at].1, own),
    )
}

/// Matches the ramps of each stretch of the session with their candidates, and makes the times `exact`.
fn matched<'a>(
    request: &AttachRequest,
    ramps: &[RampTime],
    candidates: impl Fn(usize) -> &'a [EventCandidate],
    (grain_s, length_s): (f64, f64),
    by: String,
    exact: impl Fn(usize, EventCandidate) -> EventCandidate,
) -> Result<AlignedRamps, AttachError> {
    let mut found = AlignedRamps { by, ..AlignedRamps::default() };
    let mut pairs = Vec::new();
    let mut problem = None;
    let mut first = 0;
    for stretch in ramps.chunk_by(|a, b| a.stretch == b.stretch) {
        let at = first;
        first += stretch.len();
        let expected: Vec<f64> = stretch.iter().map(|ramp| ramp.onset_s).collect();
        match match_events(&expected, |event| candidates(at + event), grain_s, length_s) {
            Err(own) => problem = problem.or(Some(own)),
            Ok(matched) => {
                for (event, own) in matched.into_iter().enumerate() {
                    let Some((own, trial)) = own.zip(stretch[event].trial) else { continue };
                    let own = exact(at + event, own);
                    let lowest = found.clock.lowest_correlation.unwrap_or(1.0).min(own.weight);
                    if matches!(request.reference, Reference::Signal { .. }) {
                        found.clock.lowest_correlation = Some(lowest);
                    }
                    found.trials.push(AlignedRamp { trial, onset_s: own.time_s, residual_s: None });
                    pairs.push((stretch[event].stretch, stretch[event].onset_s, own.time_s));
                }
            }
        }
    }
    if found.trials.is_empty() {
        let reason = match problem {
            Some(MatchProblem::Ambiguous { at_s: [a, b], found }) => format!(
                "{found} ramps of the session fit alike from {a:.3} s and from {b:.3} s of the recording on; cut the recording"
            ),
            Some(MatchProblem::TooFew { found }) => format!(
                "{found} of {} ramps are at the intervals of the session, which may be chance: is it the recording of this session, and \
                 is {} right?",
                ramps.len(),
                found_in(request)
            ),
            None => "no ramp of a trial is in it".to_owned(),
        };
        return Err(not_aligned(request, reason));
    }
    found.compare_clocks(&pairs);
    Ok(found)
}

fn found_in(request: &AttachRequest) -> &'static str {
    match request.reference {
        Reference::Trigger { .. } => "the column of the trigger, its threshold and its direction",
        Reference::Marker(_) => "the text of the markers",
        Reference::Signal { .. } => "the column, its sign and the signal that it shares",
    }
}

impl AlignedRamps {
    /// Fits one speed of the recording's clock, and an offset for each stretch, to pairs of stretch, time in the session and time in the
    /// recording, which are those of the trials.
    fn compare_clocks(&mut self, pairs: &[(usize, f64, f64)]) {
        let mut stretches: Vec<usize> = pairs.iter().map(|pair| pair.0).collect();
        stretches.sort_unstable();
        stretches.dedup();
        // A stretch that is not known has no times.
        stretches.retain(|stretch| *stretch != usize::MAX);
        let mean = |stretch: usize, of: fn(&(usize, f64, f64)) -> f64| {
            let own: Vec<f64> = pairs.iter().filter(|pair| pair.0 == stretch).map(of).collect();
            own.iter().sum::<f64>() / own.len() as f64
        };
        let means: Vec<(usize, f64, f64)> = stretches
            .iter()
            .map(|own| (*own, mean(*own, |pair| pair.1), mean(*own, |pair| pair.2)))
            .collect();
        let centred = |pair: &(usize, f64, f64)| {
            let own = means.iter().find(|mean| mean.0 == pair.0)?;
            Some((pair.1 - own.1, pair.2 - own.2))
        };
        let known: Vec<(f64, f64)> = pairs.iter().filter_map(centred).collect();
        let square: f64 = known.iter().map(|(session, _)| session * session).sum();
        if square == 0.0 {
            return;
        }
        let speed = known.iter().map(|(session, own)| session * own).sum::<f64>() / square;
        let residual = |pair: &(usize, f64, f64)| centred(pair).map(|(session, own)| own - speed * session);
        for (trial, pair) in self.trials.iter_mut().zip(pairs) {
            trial.residual_s = residual(pair);
        }
        // The speed, and an offset of each stretch, are taken from the same times.
        let free = known.len().saturating_sub(1 + means.len());
        let squares: f64 = pairs.iter().filter_map(residual).map(|own| own * own).sum();
        let largest = pairs.iter().filter_map(residual).fold(0.0, |most: f64, own| most.max(own.abs()));
        self.speed = Some(speed);
        self.clock.drift_ppm = Some((speed - 1.0) * 1e6);
        self.clock.residual_rms_s = (free > 0).then(|| (squares / free as f64).sqrt());
        self.clock.residual_largest_s = (free > 0).then_some(largest);
    }
}

/// Cuts the recording into the spans of the trials' records.
fn cut(
    request: &AttachRequest,
    name: String,
    session: &Session,
    table: &TimedTable,
    found: AlignedRamps,
    source: Vec<u8>,
) -> Aligned {
    let columns = table.columns();
    let speed = found.speed.unwrap_or(1.0);
    let (mut trials, mut left_out, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for trial in session.trials.iter().filter(|trial| !trial.record.theta_m_rad.is_empty()) {
        let mut leave =
            |because: &str| left_out.push(LeftOut { trial: trial.number, because: because.to_owned() });
        let Some(own) = found.trials.iter().find(|own| own.trial == trial.number) else {
            leave("its ramp was not found in the recording");
            continue;
        };
        let Some(onset_s) = trial.onset_s else {
            leave("it has no onset");
            continue;
        };
        let first_s = trial.record.start_s;
        let last_s = first_s + trial.record.theta_m_rad.len() as f64 / session.sample_rate_hz;
        let in_recording = |time_s: f64| own.onset_s + (time_s - onset_s) * speed;
        let from = table.times_s.partition_point(|time_s| *time_s < in_recording(first_s));
        let to = table.times_s.partition_point(|time_s| *time_s < in_recording(last_s));
        let step_s = 1.0 / table.rate_hz;
        if from == to || in_recording(first_s) < table.times_s[0] - step_s || to == table.times_s.len() {
            leave("the recording does not last from its begin to its end");
            continue;
        }
        if table.gaps.iter().any(|gap| (from.saturating_sub(1)..to).contains(gap)) {
            leave("the recording has a gap in it");
            continue;
        }
        let file = format!("trial-{:03}.csv", trial.number);
        let on_axis = |sample: usize| onset_s + (table.times_s[sample] - own.onset_s) / speed;
        parts.push((file.clone(), part(&columns, from..to, on_axis)));
        let samples = to - from;
        trials.push(AttachmentTrial {
            trial: trial.number,
            file,
            onset_s: own.onset_s,
            residual_s: own.residual_s,
            samples,
        });
    }
    let ending = request.file.extension().unwrap_or_default().to_string_lossy().into_owned();
    let source_name = format!("source.{ending}");
    let attachment = Attachment {
        format: Attachment::format(),
        program: PROGRAM.to_owned(),
        source_sha256: dataset::sha256(&source),
        source: source_name.clone(),
        table: table_name(&request.file, table.table),
        columns: columns.iter().map(|(name, _)| name.clone()).collect(),
        aligned_by: found.by,
        emg_fcr: request.emg[0].clone(),
        emg_ecr: request.emg[1].clone(),
        emg_fcr_at_mvc: request.emg_at_mvc[0],
        emg_ecr_at_mvc: request.emg_at_mvc[1],
        clock: ClockComparison { rate_hz: table.rate_hz, ..found.clock },
        trials,
        left_out,
    };
    let mut files = vec![(source_name, source)];
    files.extend(parts);
    Aligned { attachment, session: request.session.clone(), name, files }
}

/// Name of a table without the path of its file.
fn table_name(file: &Path, table: &SourceTable) -> String {
    let path = file.display().to_string();
    let rest = table.name.strip_prefix(&path).unwrap_or(&table.name);
    rest.trim_start_matches([',', ' ']).to_owned()
}

/// A table of some samples, with the times that they have on the axis of a trial.
fn part(
    columns: &[&(String, Vec<f64>)],
    samples: std::ops::Range<usize>,
    time_s: impl Fn(usize) -> f64,
) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = std::iter::once("t_s").chain(columns.iter().map(|(name, _)| name.as_str()));
    // Writing into memory does not fail.
    let _ = writer.write_record(header);
    for sample in samples {
        let time = std::iter::once(format!("{:.9}", time_s(sample)));
        let _ = writer.write_record(time.chain(columns.iter().map(|(_, values)| values[sample].to_string())));
    }
    writer.into_inner().unwrap_or_default()
}
