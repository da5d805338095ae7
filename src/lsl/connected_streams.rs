//! Finds the streams of a rig file, and holds each against its description there.

use std::sync::Arc;
use std::thread;
use std::time::Instant;

use super::clock::LslClock;
use super::inlet::{ClockOffset, FoundStream, Inlet, InletFailure, PULL_PERIOD, room};
use super::library::{LslError, LslLibrary};
use super::stamp_watch::{StampWatch, stamps_off};
use super::stream_description::DescribedStream;
use super::stream_watch::{StreamWatch, longest_silence_s};
use crate::rig::StreamSettings;

/// How long a stream is looked for, and waited for at each step of taking it in, s.
const WAIT_S: f64 = 10.0;

/// How long a second stream that fits is looked for once there is one, s.
const SECOND_WAIT_S: f64 = 1.0;

/// The streams of a rig file, found and taken in.
#[derive(Debug)]
pub struct ConnectedStreams {
    pub(super) library: Arc<LslLibrary>,
    pub(super) streams: Vec<ConnectedStream>,
    pub(super) clock: LslClock,
}

/// A stream that was found and taken in.
#[derive(Debug)]
pub(super) struct ConnectedStream {
    /// What the rig file says of it.
    pub settings: StreamSettings,
    /// What it says of itself.
    pub described: DescribedStream,
    /// Its samples.
    pub inlet: Inlet,
    /// Its health.
    pub watch: StreamWatch,
    /// The clock of its computer when it was taken in.
    pub offset: ClockOffset,
}

impl ConnectedStreams {
    /// Finds the streams, and holds each against its description in the rig file.
    ///
    /// # Errors
    /// If one is not there, there are several of it, or it is not as it must be.
    pub fn connect(library: LslLibrary, streams: &[StreamSettings]) -> Result<Self, LslError> {
        let library = Arc::new(library);
        let clock = LslClock::unknown();
        clock.read(&library);
        let streams: Result<Vec<ConnectedStream>, LslError> =
            streams.iter().map(|settings| ConnectedStream::connect(&library, settings)).collect();
        Ok(Self { streams: streams?, library, clock })
    }

    /// The watches of the streams, for the rig.
    pub fn watches(&self) -> Vec<StreamWatch> {
        self.streams.iter().map(|stream| stream.watch.clone()).collect()
    }

    /// The clock of the library, to be asked from any thread.
    pub fn clock(&self) -> LslClock {
        self.clock.clone()
    }

    /// What was found, a line for each stream.
    pub fn described(&self) -> Vec<String> {
        let line = |stream: &ConnectedStream| {
            let DescribedStream { channels, rate_hz, source_id, .. } = &stream.described;
            let again = if source_id.is_empty() {
                "; it says no source id, so it cannot be found again if it stops"
            } else {
                ""
            };
            format!(
                "stream {:?}: {} channels, {rate_hz} samples a second, clock offset {:.3} ms within {:.3} ms{again}",
                stream.settings.name,
                channels.len(),
                1e3 * stream.offset.offset_s,
                1e3 * stream.offset.uncertainty_s
            )
        };
        self.streams.iter().map(line).collect()
    }
}

impl ConnectedStream {
    fn connect(library: &Arc<LslLibrary>, settings: &StreamSettings) -> Result<Self, LslError> {
        let problem = |found: String, expected: String| LslError::Stream {
            stream: settings.name.clone(),
            found,
            expected,
        };
        let predicate = predicate(settings);
        let mut found = FoundStream::resolve(library, &predicate, 1, WAIT_S);
        if !found.is_empty() {
            found = FoundStream::resolve(library, &predicate, 2, SECOND_WAIT_S);
        }
        let stream = match found.as_slice() {
            [] => {
                let others = FoundStream::resolve(library, "name!=''", 8, SECOND_WAIT_S);
                let others: Vec<String> = others.iter().map(|own| told(&own.xml())).collect();
                return Err(problem(
                    format!("not found within {WAIT_S} s; on the network are: {}", listed(&others)),
                    "its device to run and to publish it, in the same network, under the name, type and source_id of the rig file"
                        .to_owned(),
                ));
            }
            [one] => one,
            several => {
                let several: Vec<String> = several.iter().map(|own| told(&own.xml())).collect();
                return Err(problem(
                    format!("{} streams that fit: {}", several.len(), listed(&several)),
                    "one; give its type or source_id in the rig file, or stop the other".to_owned(),
                ));
            }
        };
        let late = |what: &'static str| {
            move |_: InletFailure| {
                problem(
                    format!("{what} did not come within {WAIT_S} s"),
                    "a device that answers; is a firewall between?".to_owned(),
                )
            }
        };
        let mut inlet = stream.inlet().ok_or_else(|| {
            problem("liblsl cannot take it in".to_owned(), "memory for 360 s of it".to_owned())
        })?;
        let xml = inlet.description(WAIT_S).map_err(late("its description"))?;
        let described =
            DescribedStream::read(xml, settings).map_err(|(found, expected)| problem(found, expected))?;
        let offset = inlet.clock_offset(WAIT_S).map_err(late("the time of its computer"))?;
        inlet.open(WAIT_S).map_err(late("its data"))?;
        let watch = StampWatch::new(longest_silence_s(settings));
        let late_s = |stamp_s: f64| library.now_s() - (stamp_s + offset.offset_s);
        if let Some(late_s) = impossible_stamps(&mut inlet, &described, &watch, late_s) {
            return Err(problem(
                stamps_off(late_s),
                "stamps of when each sample was taken, by lsl_local_clock() (pylsl.local_clock()), or none, which liblsl then gives; not \
                 the time of day, and not the time since the device was switched on"
                    .to_owned(),
            ));
        }
        Ok(Self { watch: StreamWatch::new(settings), settings: settings.clone(), described, inlet, offset })
    }
}

/// How far the stamps of the newest samples that have come are behind the clock, s, if none of them is possible within the time that a look
/// for a second stream has; `None`, too, if no sample comes.
fn impossible_stamps(
    inlet: &mut Inlet,
    described: &DescribedStream,
    watch: &StampWatch,
    late_s: impl Fn(f64) -> f64,
) -> Option<f64> {
    let (channels, room) = (described.channels.len(), room(described.rate_hz));
    let (mut values, mut times_s) = (vec![0.0; room * channels], vec![0.0; room]);
    let (begun, mut found_s) = (Instant::now(), None);
    while begun.elapsed().as_secs_f64() < SECOND_WAIT_S {
        while let Ok(count) = inlet.pull(channels, &mut values, &mut times_s)
            && count > 0
        {
            found_s = Some(late_s(times_s[count - 1]));
            if found_s.is_some_and(|late_s| watch.allows(late_s)) {
                return None;
            }
        }
        thread::sleep(PULL_PERIOD);
    }
    found_s
}

/// What the library looks for: fields of the description, as XPath.
fn predicate(settings: &StreamSettings) -> String {
    let fields = [
        ("name", Some(&settings.name)),
        ("type", settings.kind.as_ref()),
        ("source_id", settings.source_id.as_ref()),
    ];
    let given = fields.iter().filter_map(|(field, text)| Some(format!("{field}=\"{}\"", (*text)?)));
    given.collect::<Vec<_>>().join(" and ")
}

/// Name, type, source id and host of a stream, for a message.
fn told(xml: &str) -> String {
    let Ok(document) = roxmltree::Document::parse(xml) else { return "one without a description".to_owned() };
    let field = |name: &str| {
        let node = document.root_element().children().find(|node| node.has_tag_name(name));
        node.and_then(|node| node.text()).unwrap_or_default().to_owned()
    };
    format!(
        "{:?} (type {:?}, source_id {:?}, on {})",
        field("name"),
        field("type"),
        field("source_id"),
        field("hostname")
    )
}

fn listed(streams: &[String]) -> String {
    if streams.is_empty() { "none".to_owned() } else { streams.join("; ") }
}
