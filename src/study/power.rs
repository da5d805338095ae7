//! How many persons and repetitions it takes to find an effect, and how often a design tells a time from an angle.
//!
//! A pool of virtual persons is simulated and fitted in full, once; studies of n persons are drawn from it with replacement and
//! put to the test that the real study would be put to. What the shares are uncertain by is the drawing (their intervals say
//! it) and the pool (a larger one says it).

use std::fmt;
use std::str::FromStr;

use super::error::UnitError;
use super::plan::{Study, Unit};
use super::population::Population;
use super::simulated_pool::{Pooled, pool};
use super::tables::Layout;
use crate::fit::QUANTITIES;
use crate::random::Stream;
use crate::rig::virtual_wrist::Surface;
use crate::statistics::{Contrast, Moments, Sample, anova, welch, wilson};

/// A parameter that an effect changes, and the quantity that shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// k_h.
    InterfaceStiffness,
    /// k_srs.
    ShortRangeStiffness,
    /// k_dec.
    StiffnessDecrement,
    /// x_e.
    ElasticLimit,
    /// x_t, through x_e at every velocity.
    SrsPeriod,
}

/// Each parameter's word, and the quantity in the tables.
const PARAMETERS: [(Parameter, &str, &str); 5] = [
    (Parameter::InterfaceStiffness, "k_h", "k_h_nm_per_rad"),
    (Parameter::ShortRangeStiffness, "k_srs", "k_srs_nm_per_rad"),
    (Parameter::StiffnessDecrement, "k_dec", "k_dec_nm_per_rad"),
    (Parameter::ElasticLimit, "x_e", "x_e_rad"),
    (Parameter::SrsPeriod, "x_t", "x_t_s"),
];

/// A change of a parameter: a fraction of it; of x_t, seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// Of what.
    pub parameter: Parameter,
    /// By how much.
    pub by: f64,
}

/// What is to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sought {
    /// A second group of persons differs (Welch's t-test of the persons' means).
    Difference(Shift),
    /// The same persons have changed in a second session (paired t-test).
    Change(Shift),
}

/// What the elastic limit of a population is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// As the study's average person has it; the paper's grows with velocity, so that x_t is constant.
    AsGiven,
    /// An angle: that of the average person at the lowest velocity, whatever the velocity.
    Angle,
}

/// How studies are drawn.
#[derive(Debug, Clone)]
pub struct Drawing {
    /// Numbers of persons (in each group).
    pub persons: Vec<u32>,
    /// Numbers of repetitions, at most the protocol's.
    pub repetitions: Vec<u32>,
    /// Studies drawn for each.
    pub studies: u32,
    /// Persons in the pool (in each group).
    pub pool: u32,
    /// Level of the tests.
    pub alpha: f64,
}

/// How often an effect was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Persons (in each group).
    pub persons: u32,
    /// Repetitions of each condition.
    pub repetitions: u32,
    /// Studies in which the effect was found.
    pub found: u32,
    /// Of so many.
    pub of: u32,
    /// Mean of the effect as estimated, in the quantity's unit.
    pub effect: f64,
}

impl Found {
    /// The share, with its 95 % interval.
    pub fn share(&self) -> (f64, f64, f64) {
        let (low, high) = wilson(self.found, self.of);
        (f64::from(self.found) / f64::from(self.of.max(1)), low, high)
    }
}

/// What a study says of the elastic limit, by the effect of velocity on x_e and on x_t.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// x_e changes with velocity, x_t does not: the paper's finding.
    Time,
    /// x_t changes, x_e does not.
    Angle,
    /// Both change.
    Neither,
    /// No change is found in either.
    Undecided,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Time, Self::Angle, Self::Neither, Self::Undecided];

    /// The word in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Angle => "angle",
            Self::Neither => "neither",
            Self::Undecided => "undecided",
        }
    }
}

impl Parameter {
    /// Index of the quantity that shows it.
    pub fn quantity(self) -> usize {
        let name = PARAMETERS.iter().find(|(own, _, _)| *own == self).map_or("", |(_, _, quantity)| quantity);
        QUANTITIES.iter().position(|quantity| *quantity == name).unwrap_or(0)
    }
}

impl FromStr for Shift {
    type Err = String;

    /// `k_srs=-0.15`, `x_t=0.002`.
    fn from_str(text: &str) -> Result<Self, String> {
        let known: Vec<&str> = PARAMETERS.iter().map(|(_, word, _)| *word).collect();
        let expected = || {
            format!(
                "expected one of {} and what it changes by, such as k_srs=-0.15 (a fraction) or x_t=0.002 (s)",
                known.join(", ")
            )
        };
        let (word, by) = text.split_once('=').ok_or_else(expected)?;
        let parameter =
            PARAMETERS.iter().find(|(_, own, _)| *own == word).map(|(parameter, _, _)| *parameter);
        let by =
            by.parse::<f64>().ok().filter(|by| by.is_finite() && *by > -0.95 && *by < 10.0 && *by != 0.0);
        Ok(Self { parameter: parameter.ok_or_else(expected)?, by: by.ok_or_else(expected)? })
    }
}

impl fmt::Display for Shift {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let word =
            PARAMETERS.iter().find(|(own, _, _)| *own == self.parameter).map_or("", |(_, word, _)| word);
        write!(f, "{word}={}", self.by)
    }
}

impl Shift {
    /// Makes the change in the average person.
    fn apply(&self, population: &mut Population) {
        let person = &mut population.average;
        let scale = |surface: &mut Surface| {
            for value in [&mut surface.at_lowest, &mut surface.per_rad_s, &mut surface.per_nm] {
                *value *= 1.0 + self.by;
            }
        };
        match self.parameter {
            Parameter::InterfaceStiffness => scale(&mut person.interface_stiffness_nm_per_rad),
            Parameter::ShortRangeStiffness => scale(&mut person.short_range_stiffness_nm_per_rad),
            Parameter::StiffnessDecrement => scale(&mut person.stiffness_decrement_nm_per_rad),
            Parameter::ElasticLimit => scale(&mut person.elastic_limit_rad),
            Parameter::SrsPeriod => {
                // x_e = v (x_t - tau): a longer time is a longer way at every velocity.
                person.elastic_limit_rad.at_lowest += 1.3 * self.by;
                person.elastic_limit_rad.per_rad_s += self.by;
            }
        }
    }
}

/// The persons of a pool as the test sees them: means over all cells, `None` where one is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Arms {
    /// Over so many repetitions.
    pub repetitions: u32,
    /// The first group, or the first session.
    pub one: Vec<Option<f64>>,
    /// The other group, or the second session of the same persons.
    pub other: Vec<Option<f64>>,
}

/// How often studies find what is sought, and the pool that they were drawn from.
pub fn power(
    study: &Study,
    sought: Sought,
    drawing: &Drawing,
    done: impl Fn() + Sync,
) -> Result<(Vec<Found>, Vec<Arms>), UnitError> {
    let arms = simulated(study, sought, drawing, done)?;
    let mut all = Vec::new();
    for own in &arms {
        for persons in &drawing.persons {
            let mut stream = Stream::new(study.seed, &format!("power/{persons}/{}", own.repetitions));
            let (mut found, mut effect) = (0, Sample::default());
            for _ in 0..drawing.studies {
                if let Some(contrast) = sought.test(own, *persons, &mut stream) {
                    found += u32::from(contrast.p() < drawing.alpha);
                    effect.add(contrast.estimate);
                }
            }
            let (persons, repetitions, of) = (*persons, own.repetitions, drawing.studies);
            all.push(Found { persons, repetitions, found, of, effect: effect.mean() });
        }
    }
    Ok((all, arms))
}

impl Sought {
    /// The effect in a study that is drawn.
    fn test(self, arms: &Arms, persons: u32, stream: &mut Stream) -> Option<Contrast> {
        match self {
            Self::Difference(_) => {
                let (one, other) = (drawn(stream, &arms.one, persons), drawn(stream, &arms.other, persons));
                welch(&other, &one)
            }
            Self::Change(_) => {
                let pairs = arms.one.iter().zip(&arms.other);
                let changes: Vec<Option<f64>> = pairs.map(|(one, other)| Some((*other)? - (*one)?)).collect();
                drawn(stream, &changes, persons).contrast()
            }
        }
    }
}

/// Both arms, simulated and fitted: other persons, or the same in another session.
fn simulated(
    study: &Study,
    sought: Sought,
    drawing: &Drawing,
    done: impl Fn() + Sync,
) -> Result<Vec<Arms>, UnitError> {
    let persons = u64::from(drawing.pool);
    let (shift, before) = match sought {
        Sought::Difference(shift) => (shift, study.clone().resized(2 * drawing.pool, 1)),
        Sought::Change(shift) => (shift, study.clone().resized(drawing.pool, 2)),
    };
    let mut changed = before.clone();
    changed.map_population(|population| shift.apply(population));
    let unit_of = |person: u64, arm: u64| match sought {
        Sought::Difference(_) => person + arm * persons,
        Sought::Change(_) => 2 * person + arm,
    };
    let layout = layout(study);
    let most = drawing.repetitions.iter().copied().max().unwrap_or(1);
    let fit = |study: &Study, arm: u64| {
        let units: Vec<Unit> = (0..persons).map(|person| study.unit(unit_of(person, arm))).collect();
        pool(study, &units, &layout.conditions, most, &done)
    };
    let (one, other) = (fit(&before, 0)?, fit(&changed, 1)?);
    let quantity = shift.parameter.quantity();
    let means =
        |pool: &[Pooled], repetitions| pool.iter().map(|person| person.mean(quantity, repetitions)).collect();
    let arms = |repetitions: &u32| Arms {
        repetitions: *repetitions,
        one: means(&one, *repetitions),
        other: means(&other, *repetitions),
    };
    Ok(drawing.repetitions.iter().map(arms).collect())
}

/// Persons drawn with replacement, of those who have a value.
fn drawn(stream: &mut Stream, pool: &[Option<f64>], persons: u32) -> Sample {
    let there: Vec<f64> = pool.iter().flatten().copied().collect();
    if there.is_empty() {
        return Sample::default();
    }
    (0..persons).map(|_| there[stream.below(there.len() as u64) as usize]).collect()
}

/// How often a study of each size says what of the elastic limit: verdicts in the order of [`Verdict::ALL`].
pub fn verdicts(
    study: &Study,
    limit: Limit,
    drawing: &Drawing,
    done: impl Fn() + Sync,
) -> Result<Vec<(u32, [u32; 4])>, UnitError> {
    let mut study = study.clone().resized(drawing.pool, 1);
    if limit == Limit::Angle {
        study.map_population(|population| population.average.elastic_limit_rad.per_rad_s = 0.0);
    }
    let layout = layout(&study);
    let repetitions = drawing.repetitions.iter().copied().max().unwrap_or(1);
    let units: Vec<Unit> = (0..study.units()).map(|index| study.unit(index)).collect();
    let pool = pool(&study, &units, &layout.conditions, repetitions, done)?;
    let of = |quantity: usize| -> Vec<Option<Vec<f64>>> {
        pool.iter().map(|person| person.all(quantity, repetitions)).collect()
    };
    let (angle, time) = (of(Parameter::ElasticLimit.quantity()), of(Parameter::SrsPeriod.quantity()));
    let both: Vec<(&Vec<f64>, &Vec<f64>)> =
        angle.iter().zip(&time).filter_map(|(a, t)| Some((a.as_ref()?, t.as_ref()?))).collect();
    let changes = |cells: Vec<&Vec<f64>>| {
        let moments = Moments::of(layout.conditions.len(), cells.into_iter().map(Vec::as_slice));
        let effects = anova(&moments, layout.design()).unwrap_or_default();
        effects.iter().find(|effect| effect.factors == [true, false]).is_some_and(|e| e.p_gg < drawing.alpha)
    };
    let mut all = Vec::new();
    for persons in &drawing.persons {
        let mut stream = Stream::new(study.seed, &format!("verdicts/{persons}"));
        let mut counts = [0; 4];
        for _ in 0..drawing.studies {
            if both.is_empty() {
                break;
            }
            let who: Vec<usize> = (0..*persons).map(|_| stream.below(both.len() as u64) as usize).collect();
            let x_e = changes(who.iter().map(|person| both[*person].0).collect());
            let x_t = changes(who.iter().map(|person| both[*person].1).collect());
            let verdict = match (x_e, x_t) {
                (true, false) => Verdict::Time,
                (false, true) => Verdict::Angle,
                (true, true) => Verdict::Neither,
                (false, false) => Verdict::Undecided,
            };
            counts[verdict as usize] += 1;
        }
        all.push((*persons, counts));
    }
    Ok(all)
}

fn layout(study: &Study) -> Layout {
    let protocol = study.protocol();
    let all = protocol.into_iter().flat_map(|protocol| {
        let torques = protocol.torques_nm.clone();
        protocol
            .velocities_rad_s
            .clone()
            .into_iter()
            .flat_map(move |v| torques.clone().into_iter().map(move |t| (v, t)))
    });
    Layout::of(all)
}
