//! Questions at the terminal that make the mapping of an import.

use std::io::{self, BufRead, IsTerminal, Write};

use crate::import::{
    IMPORT_FORMAT, LongRecord, MappedSignal, Mapping, SignalColumns, SignalUnit, SourceTable,
};
use crate::signal::FilterSpec;
use crate::wrist::Lever;

use super::failure::Failure;
use super::safe_output::SafeOutput;

const TIME_UNITS: [SignalUnit; 3] = [SignalUnit::Second, SignalUnit::Millisecond, SignalUnit::Microsecond];
const ANGLE_UNITS: [SignalUnit; 4] =
    [SignalUnit::Radian, SignalUnit::Degree, SignalUnit::Milliradian, SignalUnit::Revolution];
const TORQUE_UNITS: [SignalUnit; 5] = [
    SignalUnit::NewtonMetre,
    SignalUnit::NewtonCentimetre,
    SignalUnit::NewtonMillimetre,
    SignalUnit::KilopondCentimetre,
    SignalUnit::PoundInch,
];
const EMG_UNITS: [SignalUnit; 5] =
    [SignalUnit::Mvc, SignalUnit::Percent, SignalUnit::Millivolt, SignalUnit::Microvolt, SignalUnit::Volt];

/// Asks for the mapping of a recording whose first table is `table`. `None` if nobody can be asked.
///
/// # Errors
/// If the terminal is gone.
pub fn ask_for_mapping(table: &SourceTable) -> Result<Option<Mapping>, Failure> {
    let stdin = io::stdin();
    if !stdin.is_terminal() {
        return Ok(None);
    }
    Questions { input: stdin.lock(), output: SafeOutput(io::stderr()), table }.mapping().map(Some)
}

struct Questions<'a, I, O> {
    input: I,
    output: O,
    table: &'a SourceTable,
}

impl<I: BufRead, O: Write> Questions<'_, I, O> {
    fn mapping(&mut self) -> Result<Mapping, Failure> {
        writeln!(self.output, "{}", self.table.name)?;
        for (name, values) in &self.table.columns {
            let first: Vec<String> = values.iter().take(3).map(f64::to_string).collect();
            writeln!(self.output, "  {name}: {} values, {} ...", values.len(), first.join(", "))?;
        }
        for (name, reason) in &self.table.unusable {
            writeln!(self.output, "  {name}: not usable: {reason}")?;
        }
        let subject = self.answer("Identifier of the subject", "S01", |text| Ok(text.to_owned()))?;
        let time = self.signal("time (empty: none)", &TIME_UNITS, true)?;
        let sample_rate_hz = match time {
            Some(_) => None,
            None => Some(self.number("Samples a second", "")?),
        };
        let angle = self.signal("the angle of the motor", &ANGLE_UNITS, false)?;
        let torque = self.signal("the torque", &TORQUE_UNITS, false)?;
        let (Some(angle), Some(torque)) = (angle, torque) else {
            return Err(Failure::Usage("a session needs an angle and a torque".to_owned()));
        };
        let emg_fcr = self.signal("EMG of the flexor carpi radialis (empty: none)", &EMG_UNITS, true)?;
        let emg_ecr = self.signal("EMG of the extensor carpi radialis (empty: none)", &EMG_UNITS, true)?;
        let lever = self.lever()?;
        let recorded_filter = self.recorded_filter()?;
        let trial_column = self.column("Column that tells the trials of one table apart (empty: none)")?;
        let long_record = self.long_record()?;
        Ok(Mapping {
            schema: None,
            format: IMPORT_FORMAT.to_owned(),
            subject,
            sample_rate_hz,
            // What few recordings have is written into the mapping by hand.
            columns: SignalColumns {
                time,
                angle,
                torque,
                emg_fcr,
                emg_ecr,
                handle_angle: None,
                handle_acceleration: None,
                hand_torque: None,
                joint_angle: None,
            },
            lever,
            recorded_filter,
            long_record,
            trial_column,
        })
    }

    /// A column with unit and sign; `None` for an empty answer where that is allowed.
    fn signal(
        &mut self,
        what: &str,
        units: &[SignalUnit],
        may_lack: bool,
    ) -> Result<Option<MappedSignal>, Failure> {
        let table = self.table;
        let column = self.answer(&format!("Column of {what}"), "", |name| match table.column(name) {
            Some(_) => Ok(name.to_owned()),
            None if name.is_empty() && may_lack => Ok(String::new()),
            None => Err(format!("expected one of {}", table.names())),
        })?;
        if column.is_empty() {
            return Ok(None);
        }
        let names: Vec<String> = units.iter().map(|unit| unit.name()).collect();
        let unit = self.answer(&format!("Its unit ({})", names.join(", ")), &names[0], |text| {
            let unit = units.iter().find(|unit| unit.name() == text);
            unit.copied().ok_or_else(|| format!("expected one of {}", names.join(", ")))
        })?;
        let mut signal = MappedSignal::plain(&column, unit);
        if units == ANGLE_UNITS || units == TORQUE_UNITS {
            let question = "Its sign: 1 if a ramp that stretches the muscle, or torque that resists it, is positive, else -1";
            signal.sign = self.answer(question, "1", |text| match text {
                "1" | "+1" => Ok(1),
                "-1" => Ok(-1),
                _ => Err("expected 1 or -1".to_owned()),
            })?;
        }
        if [SignalUnit::Volt, SignalUnit::Millivolt, SignalUnit::Microvolt].contains(&unit) {
            signal.at_mvc = Some(self.number("Its value at maximal effort", "")?);
        }
        Ok(Some(signal))
    }

    fn lever(&mut self) -> Result<Option<Lever>, Failure> {
        let is_rigid = self.yes("Was the torque measured at a rigid handle?")?;
        if is_rigid {
            return Ok(None);
        }
        Ok(Some(Lever {
            inertia_kg_m2: self.number("Inertia of the lever, kg m2", "0.0016")?,
            damping_nm_s_per_rad: self.number("Its damping, N m s/rad", "0.4")?,
            stiffness_nm_per_rad: self.number("Its stiffness, N m/rad", "900")?,
        }))
    }

    fn long_record(&mut self) -> Result<Option<LongRecord>, Failure> {
        if !self.yes("Is this one long record with many ramps?")? {
            return Ok(None);
        }
        let ramp_column =
            self.column("Column that rises at each ramp (empty: find the ramps in the angle)")?;
        let threshold = if ramp_column.is_some() { self.number("Its threshold", "0.5")? } else { 0.5 };
        Ok(Some(LongRecord {
            ramp_column,
            threshold,
            before_s: self.number("Time to keep before each ramp, s", "1")?,
            after_s: self.number("Time to keep after its begin, s", "0.3")?,
        }))
    }

    /// The filter that a recorder applied to both channels.
    fn recorded_filter(&mut self) -> Result<Option<FilterSpec>, Failure> {
        if !self.yes("Was a low-pass filter applied before the recording?")? {
            return Ok(None);
        }
        let order = self.answer("Order of the Butterworth filter", "", |text| match text.parse::<u32>() {
            Ok(order) if FilterSpec::ORDERS.contains(&order) => Ok(order),
            _ => Err("expected 1 to 8".to_owned()),
        })?;
        Ok(Some(FilterSpec::Butterworth {
            order,
            cutoff_hz: self.number("Its cut-off frequency, Hz", "")?,
            zero_phase: self.yes("Was it applied forwards and backwards?")?,
        }))
    }

    /// The name of a column, `None` for an empty answer.
    fn column(&mut self, question: &str) -> Result<Option<String>, Failure> {
        let table = self.table;
        self.answer(question, "", |name| match table.column(name) {
            Some(_) => Ok(Some(name.to_owned())),
            None if name.is_empty() => Ok(None),
            None => Err(format!("expected one of {}", table.names())),
        })
    }

    fn yes(&mut self, question: &str) -> Result<bool, Failure> {
        self.answer(&format!("{question} yes or no"), "", |text| match text {
            "yes" | "y" => Ok(true),
            "no" | "n" => Ok(false),
            _ => Err("expected yes or no".to_owned()),
        })
    }

    fn number(&mut self, question: &str, default: &str) -> Result<f64, Failure> {
        self.answer(question, default, |text| match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err("expected a number, with a point".to_owned()),
        })
    }

    /// Asks until the answer can be read.
    fn answer<T>(
        &mut self,
        question: &str,
        default: &str,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, Failure> {
        loop {
            let shown = if default.is_empty() { String::new() } else { format!(" [{default}]") };
            write!(self.output, "{question}{shown}: ")?;
            self.output.flush()?;
            let mut line = String::new();
            if self.input.read_line(&mut line)? == 0 {
                return Err(Failure::Usage(
                    "the questions were not all answered; nothing was written".to_owned(),
                ));
            }
            let text = if line.trim().is_empty() { default } else { line.trim() };
            match read(text) {
                Ok(answer) => return Ok(answer),
                Err(expected) => writeln!(self.output, "{text:?}: {expected}")?,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_make_a_mapping_and_a_wrong_one_is_asked_again() {
        let column = |name: &str| (name.to_owned(), vec![0.0, 1.0]);
        let table = SourceTable::new("x.csv".into(), vec![column("Time"), column("Pos"), column("Tq")]);
        let answers = "S7\nTime\nms\nPosition\nPos\ndeg\n-1\nTq\nN cm\n\n\n\nyes\nyes\n3\n50\nno\n\nno\n";
        let mut said = Vec::new();
        let mapping =
            Questions { input: answers.as_bytes(), output: &mut said, table: &table }.mapping().unwrap();
        assert_eq!(mapping.columns.time.unwrap().unit, SignalUnit::Millisecond);
        let filter = FilterSpec::Butterworth { order: 3, cutoff_hz: 50.0, zero_phase: false };
        assert_eq!(mapping.recorded_filter, Some(filter));
        let angle = mapping.columns.angle;
        assert_eq!((angle.column.as_str(), angle.unit, angle.sign), ("Pos", SignalUnit::Degree, -1));
        assert!(
            mapping.columns.emg_fcr.is_none() && mapping.lever.is_none() && mapping.long_record.is_none()
        );
        assert!(String::from_utf8(said).unwrap().contains("\"Position\": expected one of Time, Pos, Tq"));
    }
}
