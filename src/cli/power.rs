//! `ramphold power`: how many subjects and repetitions it takes to find an effect.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::app::{
    Console, Failure, ResultsFolder, check_has_none, check_out, draw_seed, new_folder, parse_seed,
};
use crate::dataset::Disk;
use crate::fit::{QUANTITIES, write_files};
use crate::report::{PowerCurve, power_figure};
use crate::rig::virtual_wrist::MechanismList;
use crate::statistics::wilson;
use crate::study::detection_power::{Detections, detection_power, detections};
use crate::study::power::{
    LimitConclusion, LimitCounts, ParameterShift, PoolMeans, PowerEstimate, ResamplingPlan, SoughtEffect,
    TrueElasticLimit, limit_conclusions, power,
};
use crate::study::{Study, StudyError, repetitions_in_words};

use super::verb::Verb;

/// Compute power curves by simulation: the probability that a study of N subjects finds an effect.
///
/// A pool of the study's virtual subjects is simulated and fitted once. Studies are drawn from the pool with replacement,
/// and each is analysed with the test that a real study would use. The verb writes power.csv, pool.csv and power.svg.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold power protocols/de-vlugt-2011-study.json --difference k_srs=-0.15 --seed 1\n  \
                        ramphold power protocols/de-vlugt-2011-study.json --change x_t=0.002 --persons 4,8,16\n  \
                        ramphold power protocols/de-vlugt-2011-study.json --limit angle --persons 8"
)]
#[command(group = clap::ArgGroup::new("sought").required(true).multiple(false))]
pub struct PowerArgs {
    /// The study file; its subjects must be virtual.
    study: PathBuf,
    /// Effect: two groups of subjects differ in a parameter, by a fraction of k_h, k_srs, k_dec or x_e, or by seconds of x_t.
    #[arg(long, value_name = "PARAMETER=BY", allow_hyphen_values = true, group = "sought")]
    difference: Option<ParameterShift>,
    /// Effect: the same subjects change in a parameter between two sessions, by a fraction or by seconds as above.
    #[arg(long, value_name = "PARAMETER=BY", allow_hyphen_values = true, group = "sought")]
    change: Option<ParameterShift>,
    /// Effect: the law of the elastic limit. Counts what studies conclude when the limit is in truth a constant time or angle.
    #[arg(long, value_enum, group = "sought")]
    limit: Option<TrueLimit>,
    /// Effect: a mechanism of the catalogue in the virtual rig, with all its parameters, such as
    /// torque_drift:slope_nm_per_s=1,start_s=0.005. Each session is diagnosed, which takes long: start with --pool 8.
    #[arg(long, value_name = "ID:PARAMETER=VALUE,...", group = "sought", value_parser = mechanism)]
    mechanism: Option<MechanismList>,
    /// Numbers of subjects: in each group for --difference, of the study otherwise.
    #[arg(long, value_delimiter = ',', default_value = "3,4,5,6,8,10,12,16,20,24,32,40")]
    persons: Vec<u32>,
    /// Numbers of repetitions, at most that of the protocol.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    repetitions: Vec<u32>,
    /// Number of studies drawn for each combination of subjects and repetitions.
    #[arg(long, default_value_t = 2000)]
    studies: u32,
    /// Number of subjects simulated in each group.
    #[arg(long, default_value_t = 60)]
    pool: u32,
    /// Significance level of the tests.
    #[arg(long, default_value_t = 0.05)]
    alpha: f64,
    /// Seed of all random draws [default: drawn and printed].
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: Option<u64>,
    /// Folder for the results [default: a new folder under sessions/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// The true law of the elastic limit.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum TrueLimit {
    /// That of the study's average subject: a constant time, as in the paper.
    Time,
    /// A constant angle: that of the average subject at the lowest velocity.
    Angle,
}

/// Files of a power analysis.
const POWER_RESULTS: [&str; 3] = ["power.csv", "power.svg", "pool.csv"];

impl Verb for PowerArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let seed = self.seed.unwrap_or_else(draw_seed);
        let study = Study::open(&self.study, seed)?;
        let resampling = self.resampling(&study)?;
        let folder = self
            .out
            .clone()
            .unwrap_or_else(|| new_folder(&Path::new("sessions").join(format!("power-{seed}"))));
        check_out("--out", &folder)?;
        check_has_none("--out", &folder, &POWER_RESULTS)?;
        let groups = if self.limit.is_some() || self.mechanism.is_some() { 1 } else { 2 };
        console.message(format_args!(
            "study {}, seed {seed}, {} sessions",
            study.name,
            groups * resampling.pool
        ));
        if let Some(most) = resampling.subjects.last().filter(|most| **most > resampling.pool) {
            console.announce(format_args!(
                "studies of up to {most} subjects are drawn from {} simulated ones, with replacement: the power is that of these, and \
                 another pool would give another; give at least --pool {most}",
                resampling.pool
            ));
        }
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
                let labels = EffectLabels {
                    kind: "mechanism",
                    parameter: ids.join("+"),
                    by: values.join(" "),
                    quantity: "share of sessions that name it",
                    per_group: false,
                };
                let mut output = curves(&labels, &resampling, &detection_power(&study, &named, &resampling));
                output.files.push(("pool.csv", named_table(&named)));
                output
            }
            (Some(sought), _) => {
                let (found, arms) = power(&study, sought, &resampling, tick).map_err(Failure::Unit)?;
                for remark in arms.iter().filter_map(|own| own.fit.remark(study.fit)) {
                    console.message(format_args!("{remark}"));
                }
                let mut output = curves(&EffectLabels::of(sought), &resampling, &found);
                output.files.push(("pool.csv", pool_table(&arms)));
                output
            }
            (None, limit) => {
                let limit = if matches!(limit, Some(TrueLimit::Angle)) {
                    TrueElasticLimit::ConstantAngle
                } else {
                    TrueElasticLimit::AsGiven
                };
                let (said, fit) =
                    limit_conclusions(&study, limit, &resampling, tick).map_err(Failure::Unit)?;
                if let Some(remark) = fit.remark(study.fit) {
                    console.message(format_args!("{remark}"));
                }
                verdict_table(&said)
            }
        };
        progress.finish_and_clear();
        let files: Vec<(&str, &str)> =
            result.files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        write_files(&Disk::default(), &ResultsFolder::Given(folder.clone()).open()?, &files)?;
        write!(console.results(), "{}", result.text)?;
        console.message(format_args!("{}", folder.display()));
        Ok(())
    }
}

/// The files to write and the text to print.
struct PowerOutput {
    files: Vec<(&'static str, String)>,
    text: String,
}

impl PowerArgs {
    fn resampling(&self, study: &Study) -> Result<ResamplingPlan, Failure> {
        let refuse = |message: String| Err(Failure::Usage(message));
        let Some(protocol) = study.protocol() else {
            return Err(StudyError::Value {
                file: self.study.clone(),
                field: "persons.kind".into(),
                found: "measured".into(),
                expected: "virtual: power is computed by simulation. Give the measured spread to virtual subjects",
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
            return refuse(format!("--pool {}: expected 2 to 1000000 subjects", self.pool));
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

/// Labels of the effect in tables and figures.
struct EffectLabels {
    kind: &'static str,
    parameter: String,
    by: String,
    quantity: &'static str,
    /// What the numbers of subjects are: of the study, or of each of its groups.
    per_group: bool,
}

impl EffectLabels {
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
            per_group: matches!(sought, SoughtEffect::Difference(_)),
        }
    }
}

/// The power curves, by subjects and repetitions.
fn curves(labels: &EffectLabels, resampling: &ResamplingPlan, found: &[PowerEstimate]) -> PowerOutput {
    let EffectLabels { kind, parameter, by, quantity, per_group } = labels;
    let subjects = if *per_group { "subjects in each group" } else { "subjects" };
    let mut csv =
        "sought,parameter,by,quantity,repetitions,persons,studies,found,power,low,high,mean_effect\n"
            .to_owned();
    let mut text = format!("{kind} of {parameter}={by}, seen in {quantity}, at p < {}\n", resampling.alpha);
    let mut curves = Vec::new();
    for repetitions in &resampling.repetitions {
        let own: Vec<&PowerEstimate> =
            found.iter().filter(|found| found.repetitions == *repetitions).collect();
        for found in &own {
            let (share, low, high) = found.power();
            let [share, effect] =
                [share, found.effect].map(|own| if own.is_nan() { String::new() } else { own.to_string() });
            let tested = found.studies - found.untested;
            let _ = writeln!(
                csv,
                "{kind},{parameter},{by},{quantity},{repetitions},{},{tested},{},{share},{low},{high},{effect}",
                found.subjects, found.found
            );
        }
        let repetitions = repetitions_in_words(*repetitions);
        for found in own.iter().filter(|found| found.untested > 0) {
            let _ = writeln!(
                text,
                "{repetitions}, {} {subjects}: {} of {} studies could not be tested and do not count",
                found.subjects, found.untested, found.studies
            );
        }
        let enough = own.iter().find(|found| found.power().0 >= 0.8).map(|found| found.subjects);
        let needed = match (enough, own.last()) {
            (Some(persons), _) => format!("{persons} {subjects}"),
            (None, Some(last)) if last.power().0.is_nan() => {
                "a number that is not known: no study was tested".into()
            }
            (None, Some(last)) => {
                format!("more than {} {subjects} (power {:.2} with these)", last.subjects, last.power().0)
            }
            (None, None) => String::new(),
        };
        let _ = writeln!(text, "{repetitions}: power 0.8 takes {needed}");
        let point = |found: &&PowerEstimate| {
            let (share, low, high) = found.power();
            (f64::from(found.subjects), share, low, high)
        };
        let tested = own.iter().filter(|found| found.untested < found.studies);
        curves.push(PowerCurve { label: repetitions, points: tested.map(point).collect() });
    }
    let caption = format!(
        "Shares of {} studies drawn from {} virtual {subjects}, with 95 % intervals. Grey line: power 0.8.",
        resampling.studies, resampling.pool
    );
    let figure = power_figure(
        &format!("Power: {kind} of {parameter}={by}, p < {}", resampling.alpha),
        &caption,
        subjects,
        &curves,
    );
    PowerOutput { files: vec![("power.csv", csv), ("power.svg", figure)], text }
}

/// The table of the sessions whose diagnosis named the mechanism.
fn named_table(named: &[Detections]) -> String {
    let mut csv = "repetitions,person,named\n".to_owned();
    for own in named {
        for (person, named) in own.named.iter().enumerate() {
            let _ = writeln!(csv, "{},{},{named}", own.repetitions, person + 1);
        }
    }
    csv
}

/// Parses a mechanism with its parameters from the command line.
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

/// The table of the subjects that studies were drawn from.
fn pool_table(arms: &[PoolMeans]) -> String {
    let mut csv = "repetitions,person,first,second\n".to_owned();
    let cell = |value: &Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for own in arms {
        for (person, (one, other)) in own.first.iter().zip(&own.second).enumerate() {
            let _ = writeln!(csv, "{},{},{},{}", own.fit.repetitions, person + 1, cell(one), cell(other));
        }
    }
    csv
}

/// The table of what studies conclude about the elastic limit.
fn verdict_table(said: &[LimitCounts]) -> PowerOutput {
    let mut csv = "persons,studies,verdict,count,share,low,high\n".to_owned();
    let mut text =
        "conclusions of the studies about the elastic limit (share of studies)\nsubjects".to_owned();
    for verdict in LimitConclusion::ALL {
        let _ = write!(text, " {:>10}", verdict.name());
    }
    text.push('\n');
    for LimitCounts { subjects: persons, counts, untested } in said {
        let _ = write!(text, "{persons:>8}");
        let of: u32 = counts.iter().sum();
        for (verdict, count) in LimitConclusion::ALL.iter().zip(counts) {
            let share = f64::from(*count) / f64::from(of);
            let shown = if of == 0 { String::new() } else { share.to_string() };
            let (low, high) = wilson(*count, of);
            let _ = writeln!(csv, "{persons},{of},{},{count},{shown},{low},{high}", verdict.name());
            let _ = write!(text, " {share:>10.3}");
        }
        if *untested > 0 {
            let _ = write!(
                text,
                "  ({untested} of {} studies could not be tested and do not count)",
                of + untested
            );
        }
        text.push('\n');
    }
    PowerOutput { files: vec![("power.csv", csv)], text }
}
