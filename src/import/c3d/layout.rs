//! Where the samples of a C3D file are, and what its counts say.

use super::parameters::Parameters;
use super::processor::Processor;

/// Bytes of the header, and of each block that a place is counted in.
const BLOCK: usize = 512;

/// Second byte of the header of a file with markers and analog channels.
const KEY: u8 = 0x50;

/// The number of frames that says that there are too many for 16 bits.
const TOO_MANY: f64 = 65535.0;

/// Two rates that differ by more than this share are two, and not one that was rounded.
const RATES_ALIKE: f64 = 1e-4;

/// Blocks of zeros that programs write behind the last frame.
const FILL_BLOCKS: usize = 2;

/// Whether the bytes begin as a file of this kind does.
pub fn is_c3d(bytes: &[u8]) -> bool {
    matches!(bytes, [first_block, KEY, ..] if *first_block > 0)
}

/// Where the samples are.
#[derive(Debug)]
pub struct AnalogLayout<'a> {
    /// Number format.
    pub processor: Processor,
    /// Bytes of a sample: 4 of a floating-point number, 2 of an integer.
    pub sample_bytes: usize,
    /// Number of analog channels.
    pub channels: usize,
    /// Samples of each channel in a frame.
    pub samples_in_frame: usize,
    /// Samples of each channel in a second, or why that is not known.
    pub rate_hz: Result<f64, String>,
    /// Bytes of the markers in a frame, which stand before those of the channels.
    pub marker_bytes: usize,
    /// Bytes of a frame.
    pub frame_bytes: usize,
    /// The frames.
    pub frames: &'a [u8],
}

/// The numbers of the header.
struct Header {
    markers: usize,
    /// Samples of all channels in a frame.
    analog_samples: usize,
    first_frame: u16,
    last_frame: u16,
    scale: f64,
    data_block: usize,
    samples_in_frame: usize,
    frame_rate_hz: f64,
}

impl Header {
    fn read(bytes: &[u8], processor: Processor) -> Option<Self> {
        // Words are counted from 1 in the description of the format.
        let word = |number: usize| {
            let at = 2 * (number - 1);
            Some(processor.word(bytes.get(at..at + 2)?.try_into().ok()?))
        };
        let float = |number: usize| {
            let at = 2 * (number - 1);
            Some(processor.float(bytes.get(at..at + 4)?.try_into().ok()?))
        };
        Some(Self {
            markers: word(2)?.into(),
            analog_samples: word(3)?.into(),
            first_frame: word(4)?,
            last_frame: word(5)?,
            scale: float(7)?,
            data_block: word(9)?.into(),
            samples_in_frame: word(10)?.into(),
            frame_rate_hz: float(11)?,
        })
    }
}

/// The parameters of a file, and where its samples are; the error says what is wrong with it.
pub fn read(bytes: &[u8]) -> Result<(Parameters<'_>, AnalogLayout<'_>), String> {
    let cut_off = || format!("{} bytes: the file is cut off in its header or its parameters", bytes.len());
    let parameter_block = usize::from(*bytes.first().ok_or_else(cut_off)?);
    let parameters_at = BLOCK * parameter_block.saturating_sub(1);
    let header = bytes.get(..BLOCK).ok_or_else(cut_off)?;
    let processor = Parameters::read_processor(bytes.get(parameters_at..).ok_or_else(cut_off)?)?;
    let header = Header::read(header, processor).ok_or_else(cut_off)?;
    let data_at = BLOCK * header.data_block.saturating_sub(1);
    if parameters_at < BLOCK || data_at <= parameters_at {
        return Err(format!(
            "parameters in block {parameter_block} and samples in block {}, where they come in this order after the header",
            header.data_block
        ));
    }
    let section = bytes.get(parameters_at..data_at).ok_or_else(cut_off)?;
    let parameters = Parameters::read(section, processor)?;
    let layout = AnalogLayout::new(&header, &parameters, bytes, data_at)?;
    Ok((parameters, layout))
}

impl<'a> AnalogLayout<'a> {
    fn new(
        header: &Header,
        parameters: &Parameters,
        bytes: &'a [u8],
        data_at: usize,
    ) -> Result<Self, String> {
        agree("the number of markers", header.markers, parameters.count("POINT", "USED"), "POINT:USED")?;
        agree(
            "the block of the samples",
            header.data_block,
            parameters.count("POINT", "DATA_START"),
            "POINT:DATA_START",
        )?;
        let samples_in_frame = header.samples_in_frame;
        let channels = header.analog_samples.checked_div(samples_in_frame).unwrap_or(0);
        agree("the number of analog channels", channels, parameters.count("ANALOG", "USED"), "ANALOG:USED")?;
        if channels == 0 {
            return Err("no analog channels, only markers".to_owned());
        }
        if channels * samples_in_frame != header.analog_samples {
            return Err(format!(
                "{} analog samples in a frame, which is no multiple of the {samples_in_frame} of each channel",
                header.analog_samples
            ));
        }
        let sample_bytes = if is_float(header, parameters)? { 4 } else { 2 };
        let marker_bytes = 4 * sample_bytes * header.markers;
        let frame_bytes = marker_bytes + sample_bytes * header.analog_samples;
        // Rotations of segments, where there are any, come after the frames.
        let rotations_at = parameters
            .count("ROTATION", "DATA_START")
            .filter(|_| parameters.count("ROTATION", "USED").is_some_and(|used| used > 0.0))
            .map(|block| BLOCK.saturating_mul((block as usize).saturating_sub(1)))
            .filter(|at| *at > data_at);
        let data = &bytes[data_at..rotations_at.map_or(bytes.len(), |at| at.min(bytes.len()))];
        let count = frame_count(header, parameters, data, frame_bytes)?;
        Ok(Self {
            processor: parameters.processor(),
            sample_bytes,
            channels,
            samples_in_frame,
            rate_hz: rate_hz(header, parameters),
            marker_bytes,
            frame_bytes,
            frames: &data[..count * frame_bytes],
        })
    }
}

/// Refuses a header that says something else than a parameter.
fn agree(what: &str, header: usize, parameter: Option<f64>, name: &str) -> Result<(), String> {
    match parameter {
        Some(other) if other != header as f64 => {
            Err(format!("{what} is {header} in the header and {other} in {name}"))
        }
        _ => Ok(()),
    }
}

/// Whether samples are floating-point numbers: a negative scale of the markers says so.
fn is_float(header: &Header, parameters: &Parameters) -> Result<bool, String> {
    let own = header.scale;
    let other = parameters.count("POINT", "SCALE").filter(|other| *other != 0.0).unwrap_or(own);
    if own.is_nan() || other.is_nan() || own * other < 0.0 {
        return Err(format!(
            "a scale of the markers of {own} in the header and {other} in POINT:SCALE, whose sign says how samples are stored"
        ));
    }
    Ok(own < 0.0 || other < 0.0)
}

/// Samples of each channel in a second, or why that is not known.
fn rate_hz(header: &Header, parameters: &Parameters) -> Result<f64, String> {
    let frames_hz = parameters.count("POINT", "RATE").unwrap_or(header.frame_rate_hz);
    let of_frames = frames_hz * header.samples_in_frame as f64;
    let stated = parameters.count("ANALOG", "RATE").unwrap_or(of_frames);
    let is_rate = |rate_hz: f64| rate_hz > 0.0 && rate_hz.is_finite();
    if !is_rate(stated) {
        return Err(format!("ANALOG:RATE is {stated}"));
    }
    let is_same = (of_frames / stated - 1.0).abs() < RATES_ALIKE;
    if !is_same {
        return Err(format!(
            "ANALOG:RATE is {stated} Hz, and {} samples in each of {frames_hz} frames a second are {of_frames} Hz",
            header.samples_in_frame
        ));
    }
    Ok(stated)
}

/// The number of frames in `data`, which must be the one that is stated.
fn frame_count(
    header: &Header,
    parameters: &Parameters,
    data: &[u8],
    frame_bytes: usize,
) -> Result<usize, String> {
    let there = data.len() / frame_bytes;
    let Some(stated) = stated_frames(header, parameters) else {
        return frames_to_the_end(data, frame_bytes);
    };
    if !(stated >= 0.0 && stated.fract() == 0.0) {
        return Err(format!("{stated} frames are stated"));
    }
    if stated > there as f64 {
        return Err(format!("{there} frames, {stated} are stated: the file is cut off"));
    }
    let count = stated as usize;
    // What stands in the rest of the last block is of no meaning.
    let end = (count * frame_bytes).next_multiple_of(BLOCK).min(data.len());
    if data[end..].iter().any(|byte| *byte != 0) {
        return Err(format!(
            "{there} frames, {stated} are stated: the count is wrong, or something else follows"
        ));
    }
    Ok(count)
}

/// The number of frames that the parameters state; `None` if they say that it is too large for them.
fn stated_frames(header: &Header, parameters: &Parameters) -> Option<f64> {
    let in_header = f64::from(header.last_frame) - f64::from(header.first_frame) + 1.0;
    let stated = parameters.count("POINT", "FRAMES").unwrap_or(in_header);
    if stated != TOO_MANY {
        return Some(stated);
    }
    let long = parameters.count("POINT", "LONG_FRAMES");
    let number_of = |field: &str| match parameters.numbers("TRIAL", field, false)?[..] {
        [low, high] => Some(low + 65536.0 * high),
        _ => None,
    };
    let of_trial = || Some(number_of("ACTUAL_END_FIELD")? - number_of("ACTUAL_START_FIELD")? + 1.0);
    long.or_else(of_trial)
}

/// The number of frames in a file that does not say it: all that are there, but for the zeros that fill the last blocks.
fn frames_to_the_end(data: &[u8], frame_bytes: usize) -> Result<usize, String> {
    let last = data.iter().rposition(|byte| *byte != 0).map_or(0, |at| at + 1);
    let most_fill = (data.len() - last).min(FILL_BLOCKS * BLOCK);
    let count = (data.len() - most_fill).div_ceil(frame_bytes);
    if count * frame_bytes > data.len() {
        return Err("a last frame that is not whole: the file is cut off".to_owned());
    }
    Ok(count)
}
