//! Prior probabilities of causes.
//!
//! Each cause is at work or not, independently of the others; that none is has probability 1/2. The rest is spread evenly over the places
//! of the model, so that ten constants of a rig do not outvote one friction, and within a place evenly over its mechanisms, beside which
//! the functions in no catalogue have a share of their own.

use crate::wrist::mechanisms::{CATALOGUE, MechanismKind, Place};

/// Share of a place that its free laws have.
const FREE_SHARE: f64 = 0.25;

const PLACES: [Place; 6] =
    [Place::Joint, Place::Interface, Place::Handle, Place::TorqueChannel, Place::AngleChannel, Place::Trials];

/// Prior odds of each cause.
#[derive(Debug, Clone)]
pub struct ModelPrior {
    odds: Vec<(MechanismKind, f64)>,
}

impl ModelPrior {
    /// Odds for a session in which the mechanisms and free laws `applicable` can be at work.
    pub fn new(applicable: &[MechanismKind]) -> Self {
        let place_of = |kind: MechanismKind| match kind.free_law() {
            Some(law) => law.place,
            None => kind.law_space().place,
        };
        let share = std::f64::consts::LN_2 / PLACES.len() as f64;
        let odds = applicable.iter().map(|kind| {
            let alike = |other: &&MechanismKind| {
                place_of(**other) == place_of(*kind) && other.is_free_law() == kind.is_free_law()
            };
            let all = applicable.iter().filter(alike).count() as f64;
            let others = applicable.iter().any(|other| {
                place_of(*other) == place_of(*kind) && other.is_free_law() != kind.is_free_law()
            });
            let part = match (others, kind.is_free_law()) {
                (false, _) => 1.0,
                (true, true) => FREE_SHARE,
                (true, false) => 1.0 - FREE_SHARE,
            };
            (*kind, share * part / all)
        });
        Self { odds: odds.collect() }
    }

    /// Probability that a law in no catalogue is at work.
    pub fn of_unknown_law(&self) -> f64 {
        let unknown = self.odds.iter().filter(|(kind, _)| kind.is_free_law());
        1.0 - unknown.map(|(_, odds)| 1.0 / (1.0 + odds)).product::<f64>()
    }

    /// Logarithm of the prior odds of a model with the causes `kinds` against one with none.
    pub fn log_odds(&self, kinds: &[MechanismKind]) -> f64 {
        let of = |kind: &MechanismKind| {
            self.odds.iter().find(|(own, _)| own == kind).map_or(0.0, |(_, odds)| *odds)
        };
        kinds.iter().map(|kind| libm::log(of(kind))).sum()
    }
}

/// The mechanisms of the catalogue that a session can be asked about by comparing models.
pub fn compared(is_missing: impl Fn(MechanismKind) -> bool) -> Vec<MechanismKind> {
    use crate::wrist::mechanisms::EvidenceSource::{AcrossTrials, SingleTrials, Trace};
    let is_compared = |kind: &MechanismKind| {
        matches!(kind.evidence(), Trace | AcrossTrials | SingleTrials) && !is_missing(*kind)
    };
    CATALOGUE.iter().copied().filter(is_compared).collect()
}
