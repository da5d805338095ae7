//! `ramphold power`: how many persons and repetitions an effect takes.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use ramphold::dataset::Disk;
use ramphold::fit::{QUANTITIES, write_files};
use ramphold::report::{PowerCurve, power_figure};
use ramphold::rig::virtual_wrist::MechanismList;
use ramphold::statistics::wilson;
use ramphold::study::detection_power::{Detections, detection_power, detections};
use ramphold::study::power::{
    LimitConclusion, ParameterShift, PoolMeans, PowerEstimate, ResamplingPlan, SoughtEffect,
    TrueElasticLimit, limit_conclusions, power,
};
use ramphold::study::{Study, StudyError};

use super::{Console, Failure, Verb};
use crate::app::{draw_seed, new_folder};

/// Tell how often studies of so many persons would find an effect: power curves by simulation.
///
/// A pool of the study's virtual persons is simulated and fitted in full, once; studies are drawn from it with replacement, and
/// each is put to the test that the real one would be put to.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold power protocols/de-vlugt-2011-study.json --difference k_srs=-0.15 --seed 1\n  \
                        ramphold power protocols/de-vlugt-2011-study.json --change x_t=0.002 --persons 4,8,16\n  \
                        ramphold power protocols/de-vlugt-2011-study.json --limit angle --persons 8"
)]
#[command(group = clap::ArgGroup::new("sought").required(true).multiple(false))]
pub struct Power {
    /// The study file; its persons must be virtual.
    study: PathBuf,
    /// Two groups of persons differ: a fraction of k_h, k_srs, k_dec or x_e, or seconds of x_t.
    #[arg(long, value_name = "PARAMETER=BY", allow_hyphen_values = true, group = "sought")]
    difference: Option<ParameterShift>,
    /// The same persons change between two sessions, by as much.
    #[arg(long, value_name = "PARAMETER=BY", allow_hyphen_values = true, group = "sought")]
    change: Option<ParameterShift>,
    /// What a study says of the elastic limit (constant time, constant angle), where it is in truth one of them.
    #[arg(long, value_enum, group = "sought")]
    limit: Option<TrueLimit>,
    /// A mechanism of the catalogue at work in the rig, with all its parameters, such as
    /// torque_drift:slope_nm_per_s=1,start_s=0.005. Every session is diagnosed, which takes long: begin with --pool 8.
    #[arg(long, value_name = "ID:PARAMETER=VALUE,...", group = "sought", value_parser = mechanism)]
    mechanism: Option<MechanismList>,
    /// Numbers of persons, in each group.
    #[arg(long, value_delimiter = ',', default_value = "3,4,5,6,8,10,12,16,20,24,32,40")]
    persons: Vec<u32>,
    /// Numbers of repetitions, at most the protocol's.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    repetitions: Vec<u32>,
    /// Studies drawn for each number of persons and repetitions.
    #[arg(long, default_value_t = 2000)]
    studies: u32,
    /// Persons simulated, in each group.
    #[arg(long, default_value_t = 60)]
    pool: u32,
    /// Level of the tests.
    #[arg(long, default_value_t = 0.05)]
    alpha: f64,
    /// The seed of every random draw; drawn and printed if not given.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Where to write, a new folder; one under sessions/ if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// What the elastic limit is in truth.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum TrueLimit {
    /// As the study's average person has it: in the paper's, a time.
    Time,
    /// An angle: that of the average person at the lowest velocity.
    Angle,
}

impl Verb for Power {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let seed = self.seed.unwrap_or_else(draw_seed);
        let study = Study::open(&self.study, seed)?;
        let resampling = self.resampling(&study)?;
        let folder = self
            .out
            .clone()
            .unwrap_or_else(|| new_folder(&Path::new("sessions").join(format!("power-{seed}"))));
        if folder.join("power.csv").exists() {
            return Err(Failure::Usage(format!(
                "{}: holds the results of an earlier one, which are not overwritten; give another --out",
                folder.display()
            )));
        }
        let groups = if self.limit.is_some() || self.mechanism.is_some() { 1 } else { 2 };
        console.message(format_args!(
            "study {}, seed {seed}, {} sessions",
            study.name,
            groups * resampling.pool
        ));
        let progress = console.progress(u64::from(groups * resampling.pool), "sessions");
        let tick = || progress.inc(1);
        let sought = match (self.difference, self.change) {
            (Some(shift), _) => Some(SoughtEffect::Difference(shift)),
            (_, Some(shift)) => Some(SoughtEffect::Change(shift)),
            _ => None,
        };
        let result = match (sought, self.limit) {
            _ if self.mechanism.is_some() => {
                let mechanisms = self.mechanism.clone().unwrap_or_default();
                let named = detections(&study, &mechanisms, &resampling, tick).map_err(Failure::Unit)?;
                let ids: Vec<&str> = mechanisms.kinds.iter().map(|kind| kind.id()).collect();
                let values: Vec<String> = mechanisms.parameters.iter().map(f64::to_string).collect();
                let what = What {
                    kind: "mechanism",
                    parameter: ids.join("+"),
                    by: values.join(" "),
                    quantity: "share of sessions that name it",
                };
                let mut told = curves(&what, &resampling, &detection_power(&study, &named, &resampling));
                told.files.push(("pool.csv", named_table(&named)));
                told
            }
            (Some(sought), _) => {
                let (found, arms) = power(&study, sought, &resampling, tick).map_err(Failure::Unit)?;
                let mut told = curves(&What::of(sought), &resampling, &found);
                told.files.push(("pool.csv", pool_table(&arms)));
                told
            }
            (None, limit) => {
                let limit = if matches!(limit, Some(TrueLimit::Angle)) {
                    TrueElasticLimit::ConstantAngle
                } else {
                    TrueElasticLimit::AsGiven
                };
                let said = limit_conclusions(&study, limit, &resampling, tick).map_err(Failure::Unit)?;
                verdict_table(&resampling, &said)
            }
        };
        progress.finish_and_clear();
        let files: Vec<(&str, &str)> =
            result.files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        write_files(&Disk::default(), &folder, &files)?;
        write!(console.results(), "{}", result.words)?;
        console.message(format_args!("{}", folder.display()));
        Ok(())
    }
}

/// Files, and what a person is told.
struct Told {
    files: Vec<(&'static str, String)>,
    words: String,
}

impl Power {
    fn resampling(&self, study: &Study) -> Result<ResamplingPlan, Failure> {
        let refuse = |message: String| Err(Failure::Usage(message));
        let Some(protocol) = study.protocol() else {
            return Err(StudyError::Value {
                file: self.study.clone(),
                field: "persons.kind".into(),
                found: "measured".into(),
                expected: "virtual: power is found by simulation. Give the measured spread to virtual persons",
            }
            .into());
        };
        if let Some(bad) = self.repetitions.iter().find(|r| !(1..=protocol.repetitions).contains(*r)) {
            return refuse(format!(
                "--repetitions {bad}: expected 1 to {}, the protocol's",
                protocol.repetitions
            ));
        }
        if let Some(bad) = self.persons.iter().find(|n| !(2..=10_000).contains(*n)) {
            return refuse(format!("--persons {bad}: expected 2 to 10000"));
        }
        if !(2..=1_000_000).contains(&self.pool) {
            return refuse(format!("--pool {}: expected 2 to 1000000 persons", self.pool));
        }
        if !(1..=1_000_000).contains(&self.studies) {
            return refuse(format!("--studies {}: expected 1 to 1000000", self.studies));
        }
        if !(self.alpha > 0.0 && self.alpha < 1.0) {
            return refuse(format!("--alpha {}: expected a number between 0 and 1", self.alpha));
        }
        let mut resampling = ResamplingPlan {
            subjects: self.persons.clone(),
            repetitions: self.repetitions.clone(),
            studies: self.studies,
            pool: self.pool,
            alpha: self.alpha,
        };
        for numbers in [&mut resampling.subjects, &mut resampling.repetitions] {
            numbers.sort_unstable();
            numbers.dedup();
        }
        Ok(resampling)
    }
}

/// What is sought, in words.
struct What {
    kind: &'static str,
    parameter: String,
    by: String,
    quantity: &'static str,
}

impl What {
    fn of(sought: SoughtEffect) -> Self {
        let (kind, shift) = match sought {
            SoughtEffect::Difference(shift) => ("difference", shift),
            SoughtEffect::Change(shift) => ("change", shift),
        };
        let word = shift.to_string();
        let (parameter, by) = word.split_once('=').unwrap_or((&word, ""));
        Self {
            kind,
            parameter: parameter.into(),
            by: by.into(),
            quantity: QUANTITIES[shift.parameter.quantity()],
        }
    }
}

/// Power by persons and repetitions.
fn curves(what: &What, resampling: &ResamplingPlan, found: &[PowerEstimate]) -> Told {
    let What { kind, parameter, by, quantity } = what;
    let mut csv =
        "sought,parameter,by,quantity,repetitions,persons,studies,found,power,low,high,mean_effect\n"
            .to_owned();
    let mut words = format!("{kind} of {parameter}={by}, seen in {quantity}, at p < {}\n", resampling.alpha);
    let mut curves = Vec::new();
    for repetitions in &resampling.repetitions {
        let own: Vec<&PowerEstimate> =
            found.iter().filter(|found| found.repetitions == *repetitions).collect();
        for found in &own {
            let (share, low, high) = found.power();
            let _ = writeln!(
                csv,
                "{kind},{parameter},{by},{quantity},{repetitions},{},{},{},{share},{low},{high},{}",
                found.subjects, found.studies, found.found, found.effect
            );
        }
        let enough = own.iter().find(|found| found.power().0 >= 0.8).map(|found| found.subjects);
        let needed = match (enough, own.last()) {
            (Some(persons), _) => format!("{persons} persons"),
            (None, Some(last)) => {
                format!("more than {} persons ({:.2} there)", last.subjects, last.power().0)
            }
            (None, None) => String::new(),
        };
        let _ = writeln!(words, "{repetitions} repetitions: power 0.8 takes {needed}");
        let point = |found: &&PowerEstimate| {
            let (share, low, high) = found.power();
            (f64::from(found.subjects), share, low, high)
        };
        let label = format!("{repetitions} repetitions");
        curves.push(PowerCurve { label, points: own.iter().map(point).collect() });
    }
    let caption = format!(
        "Shares of {} studies drawn from {} virtual persons (in each group), with 95 % intervals; grey: power 0.8.",
        resampling.studies, resampling.pool
    );
    let figure = power_figure(
        &format!("Power: {kind} of {parameter}={by}, p < {}", resampling.alpha),
        &caption,
        &curves,
    );
    Told { files: vec![("power.csv", csv), ("power.svg", figure)], words }
}

/// Which sessions named the mechanism.
fn named_table(named: &[Detections]) -> String {
    let mut csv = "repetitions,person,named\n".to_owned();
    for own in named {
        for (person, named) in own.named.iter().enumerate() {
            let _ = writeln!(csv, "{},{},{named}", own.repetitions, person + 1);
        }
    }
    csv
}

/// A mechanism with its parameters, as it is written on the command line.
fn mechanism(text: &str) -> Result<MechanismList, String> {
    let (id, parameters) = text.split_once(':').unwrap_or((text, ""));
    let mut values = serde_json::Map::new();
    for parameter in parameters.split(',').filter(|parameter| !parameter.is_empty()) {
        let value =
            parameter.split_once('=').and_then(|(name, value)| Some((name, value.parse::<f64>().ok()?)));
        let (name, value) = value.ok_or_else(|| format!("{parameter:?}: expected PARAMETER=NUMBER"))?;
        values.insert(name.to_owned(), value.into());
    }
    let written = serde_json::json!([{ "mechanism": id, "parameters": values }]);
    serde_json::from_value(written).map_err(|error| error.to_string())
}

/// The persons that studies were drawn from.
fn pool_table(arms: &[PoolMeans]) -> String {
    let mut csv = "repetitions,person,first,second\n".to_owned();
    let cell = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for own in arms {
        for (person, (one, other)) in own.first.iter().zip(&own.second).enumerate() {
            let _ = writeln!(csv, "{},{},{},{}", own.repetitions, person + 1, cell(one), cell(other));
        }
    }
    csv
}

/// What studies say of the elastic limit.
fn verdict_table(resampling: &ResamplingPlan, said: &[(u32, [u32; 4])]) -> Told {
    let mut csv = "persons,studies,verdict,count,share,low,high\n".to_owned();
    let mut words = "what studies say of the elastic limit (share of studies)\npersons".to_owned();
    for verdict in LimitConclusion::ALL {
        let _ = write!(words, " {:>10}", verdict.name());
    }
    words.push('\n');
    for (persons, counts) in said {
        let _ = write!(words, "{persons:>7}");
        let of: u32 = counts.iter().sum();
        for (verdict, count) in LimitConclusion::ALL.iter().zip(counts) {
            let share = f64::from(*count) / f64::from(of.max(1));
            let (low, high) = wilson(*count, of);
            let _ = writeln!(
                csv,
                "{persons},{},{},{count},{share},{low},{high}",
                resampling.studies,
                verdict.name()
            );
            let _ = write!(words, " {share:>10.3}");
        }
        words.push('\n');
    }
    Told { files: vec![("power.csv", csv)], words }
}
