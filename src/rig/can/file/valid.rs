//! Reads and checks a rig file.

use std::path::Path;

use crate::files::{self, limits};
use crate::protocol::Problem;
use crate::protocol::shape::{Shape, Walked};
use crate::protocol::source::JsonNode;
use crate::rig::can::budget::{Budget, When};
use crate::rig::can::units::{BusPeriod, SamplePeriod};

use super::error::CanRigFileError;
use super::misfits::misfits;
use super::motors::MotorSettings;
use super::rig_file::CanRigFile;
use super::{rules, schema};

/// How a problem of no single field names its place.
const WHOLE_FILE: &str = "the rig file";

/// A rig file that passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidRigFile {
    file: CanRigFile,
    text: String,
    name: String,
    period: BusPeriod,
    budget: Budget,
}

impl ValidRigFile {
    /// Reads a rig file.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn read(path: &Path) -> Result<Self, CanRigFileError> {
        let file = path.display().to_string();
        let text = files::read_text(path, limits::SETTINGS_BYTES)
            .map_err(|source| CanRigFileError::Unreadable { file: file.clone(), source })?;
        Self::parse(&text, &file)
    }

    /// Reads a rig from its JSON `text`; `name` is that of the file, for messages.
    ///
    /// # Errors
    /// Everything that is wrong with it, at once.
    pub fn parse(text: &str, name: &str) -> Result<Self, CanRigFileError> {
        let source = JsonNode::parse(text, name).map_err(CanRigFileError::NotJson)?;
        let invalid = |mut problems: Vec<Problem>| {
            problems.sort_by_key(|problem| problem.line);
            CanRigFileError::Invalid { file: name.to_owned(), problems }
        };
        let (file, mut problems) = typed(&source);
        let told: Vec<String> = problems.iter().map(|problem| problem.path.clone()).collect();
        let file = match file {
            Ok(file) => file,
            Err(problem) => {
                // A stand-in for a missing object may lack fields itself.
                problems.extend((!depends_on(&problem.path, &told)).then_some(problem));
                return Err(invalid(problems));
            }
        };
        let more = rules::problems(&file, &source);
        problems.extend(more.into_iter().filter(|problem| !depends_on(&problem.path, &told)));
        let (Some(period), true) = (BusPeriod::from_us(file.period_us), problems.is_empty()) else {
            return Err(invalid(problems));
        };
        let misfits = misfits(&file, &source);
        if !misfits.is_empty() {
            return Err(invalid(misfits));
        }
        let budget = budget(&file);
        if let Some(problem) = rules::overload(&file, &budget, period, &source) {
            return Err(invalid(vec![problem]));
        }
        Ok(Self { file, text: text.to_owned(), name: name.to_owned(), period, budget })
    }

    /// The text it was read from, byte for byte.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The file as it was named.
    pub fn file_name(&self) -> &str {
        &self.name
    }

    /// Time from one SYNC to the next.
    pub fn period(&self) -> BusPeriod {
        self.period
    }

    /// Time from one sample to the next.
    pub fn sample_period(&self) -> SamplePeriod {
        self.period.with_samples(self.file.signals.torque.samples)
    }

    /// What a cycle costs on the bus.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }
}

impl std::ops::Deref for ValidRigFile {
    type Target = CanRigFile;

    fn deref(&self) -> &CanRigFile {
        &self.file
    }
}

/// The typed file, and everything that is wrong with the shape of the document. Where something is, a stand-in of no meaning
/// takes its place, so that the rules can be checked on the rest.
fn typed(source: &JsonNode) -> (Result<CanRigFile, Problem>, Vec<Problem>) {
    let shape = Shape {
        schema: schema::schema(),
        example: "fixtures/can/rigs/packed.json",
        format_error: schema::format_error,
        format_example: schema::format_example,
    };
    let Walked { mut problems, mut repaired } = shape.walk(source);
    for problem in &mut problems {
        if problem.path.is_empty() {
            problem.path = WHOLE_FILE.to_owned();
        }
        if problem.expected.starts_with("no field of this name") {
            let name = problem.path.rsplit('.').next().unwrap_or_default();
            problem.expected = format!("{} (unknown field `{name}`)", problem.expected);
        }
    }
    if let Some(members) = repaired.as_object_mut() {
        members.remove("$schema");
    }
    let file = serde_path_to_error::deserialize(repaired).map_err(|error| {
        let path = error.path().to_string();
        let place = source.at(&path);
        Problem {
            line: place.map_or(1, |node| node.line),
            value: place.map(ToString::to_string),
            expected: error.inner().to_string(),
            advice: "compare with the example in docs/how-to/real-motor.md".to_owned(),
            path: if path == "." { WHOLE_FILE.to_owned() } else { path },
        }
    });
    (file, problems)
}

/// Whether what a rule says of a field rests on a field whose problem is told already.
fn depends_on(path: &str, told: &[String]) -> bool {
    let inside = |inner: &str, outer: &str| {
        inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    told.iter().any(|wrong| match wrong.as_str() {
        WHOLE_FILE => true,
        // Nothing can be said of what the motor needs while it is not known which kind it is.
        "motor" | "motor.kind" => ["motor", "frames", "sensors", "bench", "display", "period_us"]
            .iter()
            .any(|part| inside(path, part)),
        wrong => inside(path, wrong) || inside(wrong, path),
    })
}

fn budget(file: &CanRigFile) -> Budget {
    let mut budget = Budget::default();
    let own_heartbeat = u32::from(file.master.heartbeat_ms);
    budget.add("SYNC", 0, When::EachPeriod);
    budget.add("target", file.target_bytes(), When::EachPeriod);
    for frame in &file.frames {
        let name = format!("{:?}", frame.carries);
        budget.add(name.trim_matches(['[', ']']), file.frame_bytes(frame), When::EachPeriod);
    }
    budget.add("heartbeat of this program", 1, When::EveryMs(own_heartbeat));
    match &file.motor {
        MotorSettings::Cia402(motor) => {
            budget.add("heartbeat of the motor", 1, When::EveryMs(u32::from(motor.heartbeat_ms)));
        }
        MotorSettings::Cansimple(motor) => {
            budget.add("heartbeat of the motor", 8, When::EveryMs(u32::from(motor.heartbeat_ms)));
            budget.add("position of the motor", 8, When::EveryMs(u32::from(motor.encoder_ms)));
        }
        MotorSettings::Mit(_) => budget.add("reply of the motor", 8, When::EachPeriod),
    }
    for sensor in &file.sensors {
        let name = format!("heartbeat of node {}", sensor.node);
        budget.add(name, 1, When::EveryMs(u32::from(sensor.heartbeat_ms)));
    }
    budget
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    const PLAIN: &str = include_str!("../../../../fixtures/can/rigs/plain.json");

    fn told(change: impl FnOnce(&mut Value)) -> Vec<String> {
        let mut rig: Value = serde_json::from_str(PLAIN).unwrap();
        change(&mut rig);
        match ValidRigFile::parse(&format!("{rig:#}"), "rig.json") {
            Err(CanRigFileError::Invalid { problems, .. }) => {
                problems.into_iter().map(|problem| problem.path).collect()
            }
            other => panic!("{other:?}"),
        }
    }

    /// Types, missing and unknown fields, texts that name nothing, ranges, and fields that do not fit together.
    #[test]
    fn a_file_with_fifteen_mistakes_of_every_sort_tells_all_fifteen_and_nothing_else() {
        let mut told = told(|rig| {
            rig["bus"] = json!("can0");
            rig["bit_rate"] = json!(123_456);
            rig["master"]["heartbeat_ms"] = json!("20");
            rig["master"]["node"] = json!(5);
            rig["motor"]["gear_ratio"] = json!(0);
            rig["motor"].as_object_mut().unwrap().remove("rated_torque_nm");
            rig["motor"]["homing"]["methode"] = json!(1);
            rig["motor"]["homing"]["timeout_s"] = json!(1000);
            rig["frames"][1]["id"] = json!(0x80);
            rig["signals"]["torque"]["type"] = json!("i12");
            rig["signals"]["emg_fcr"]["object"] = json!("2E00");
            rig["limits"]["angle_rad"] = json!([0.1, 0.3]);
            rig["limits"]["speed_rad_s"] = json!(-5);
            rig["safe_state"]["bus"] = json!("stop");
            rig["tolerate"]["error_frames"] = json!(-1);
        });
        let mut expected = [
            "bus",
            "bit_rate",
            "master.heartbeat_ms",
            "motor.node",
            "motor.gear_ratio",
            "motor.rated_torque_nm",
            "motor.homing.methode",
            "motor.homing.timeout_s",
            "frames[1]",
            "signals.torque.type",
            "signals.emg_fcr.object",
            "limits.angle_rad",
            "limits.speed_rad_s",
            "safe_state.bus",
            "tolerate.error_frames",
        ];
        told.sort_unstable();
        expected.sort_unstable();
        assert_eq!(told, expected);
    }

    #[test]
    fn a_stream_is_checked_with_the_rest_of_the_file() {
        let streams = |silent_s: Value, label: &str| {
            let stream = json!({ "name": "EMG", "unit": "uV", "emg_ecr": { "label": label }, "tolerate": { "silent_s": silent_s } });
            json!([stream])
        };
        assert!(ValidRigFile::parse(PLAIN, "rig.json").unwrap().streams.is_empty());
        let mut rig: Value = serde_json::from_str(PLAIN).unwrap();
        rig["streams"] = streams(Value::Null, "ECR");
        let read = ValidRigFile::parse(&rig.to_string(), "rig.json").unwrap();
        assert_eq!((read.streams[0].name.as_str(), read.streams[0].tolerate.silent_s), ("EMG", None));
        let found = told(|rig| rig["streams"] = streams(json!(0.01), "a\"b"));
        assert_eq!(found, ["streams[0].emg_ecr", "streams[0].tolerate.silent_s"]);
        let missing = told(|rig| rig["streams"] = json!([{ "name": "EMG" }]));
        assert!(missing.len() > 1 && missing.iter().all(|own| own.starts_with("streams")), "{missing:?}");
        let without_tolerance = told(|rig| rig["streams"] = json!([{ "name": "EMG", "unit": "uV" }]));
        assert_eq!(without_tolerance, ["streams[0].tolerate"]);
    }

    #[test]
    fn each_single_mistake_is_told_alone() {
        type Change = &'static dyn Fn(&mut Value);
        let cases: [(&str, Change); 5] = [
            ("motor.kind", &|rig| rig["motor"]["kind"] = json!("servo")),
            ("signals.torque.samples", &|rig| rig["signals"]["torque"]["samples"] = json!("one")),
            ("frames", &|rig| rig["frames"] = json!({})),
            ("motor.homing", &|rig| rig["motor"]["homing"] = json!(37)),
            ("lever", &|rig| drop(rig.as_object_mut().unwrap().remove("lever"))),
        ];
        for (path, change) in cases {
            assert_eq!(told(change), [path]);
        }
    }

    #[test]
    fn an_unknown_field_is_named_with_those_that_there_are() {
        let text = PLAIN.replacen('{', "{ \"surprise\": 1,", 1);
        let error = ValidRigFile::parse(&text, "rig.json").unwrap_err().to_string();
        assert!(error.contains("unknown field `surprise`") && error.contains("safe_state"), "{error}");
    }

    #[test]
    fn a_file_that_names_its_schema_for_an_editor_is_valid() {
        let text = PLAIN.replacen('{', "{ \"$schema\": \"rig.schema.json\",", 1);
        ValidRigFile::parse(&text, "rig.json").unwrap();
    }
}
