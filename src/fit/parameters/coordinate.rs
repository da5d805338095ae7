//! One coordinate of the optimisation, and the transformation from coordinates to a parameter of a trial.

use crate::fit::model::specification::LawTerm;

/// Bounds and starting value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundedStart {
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Starting value.
    pub start: f64,
}

/// A coordinate: one number that the optimisation changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// Index of its parameter in the parameter vector of a trial.
    pub parameter: usize,
    /// The term of a law whose coefficient the coordinate is; `None` if the parameter has no law.
    pub term: Option<LawTerm>,
    /// Whether the coordinate is the logarithm of the parameter.
    pub logarithmic: bool,
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Starting value.
    pub start: f64,
    /// Size of a notable change.
    pub scale: f64,
    /// Mean and standard deviation of a Gaussian prior; `None` without a prior.
    pub prior: Option<(f64, f64)>,
}

impl Coordinate {
    /// The coordinate of a parameter within `bounds`, and a constructor of the transformation from the index of the coordinate to
    /// the parameter. The coordinate is the logarithm of a parameter whose lower bound is positive.
    pub(in crate::fit) fn of(parameter: usize, bounds: BoundedStart) -> (Self, fn(usize) -> Transform) {
        let logarithmic = bounds.low > 0.0;
        let transformed = |x: f64| if logarithmic { libm::log(x) } else { x };
        let scale = bounds.start.abs().max(1e-6 * (bounds.high - bounds.low).min(1e3)).max(1e-12);
        let coordinate = Self {
            parameter,
            term: None,
            logarithmic,
            low: transformed(bounds.low),
            high: transformed(bounds.high),
            start: transformed(bounds.start),
            scale: if logarithmic { 1.0 } else { scale },
            prior: None,
        };
        let exponential: fn(usize) -> Transform =
            |coordinate| Transform::Logarithmic { coordinate, factor: 1.0 };
        let identity: fn(usize) -> Transform = |coordinate| Transform::Sum(vec![(coordinate, 1.0)]);
        (coordinate, if logarithmic { exponential } else { identity })
    }
}

/// Transformation from the coordinates to one parameter of a trial.
#[derive(Debug, Clone, PartialEq)]
pub enum Transform {
    /// The parameter has this value, whatever the coordinates are.
    Fixed(f64),
    /// The parameter is `factor` times the exponential of a coordinate, which is its logarithm.
    Logarithmic {
        /// Index of the coordinate.
        coordinate: usize,
        /// Factor of the exponential.
        factor: f64,
    },
    /// The parameter is a sum of coordinates, given by index, times factors.
    Sum(Vec<(usize, f64)>),
}

impl Transform {
    /// The transformation with each index of a coordinate replaced by `index` of it.
    pub(in crate::fit) fn reindexed(&self, index: impl Fn(usize) -> usize) -> Self {
        match self {
            Self::Fixed(value) => Self::Fixed(*value),
            Self::Logarithmic { coordinate, factor } => {
                Self::Logarithmic { coordinate: index(*coordinate), factor: *factor }
            }
            Self::Sum(terms) => Self::Sum(terms.iter().map(|(own, factor)| (index(*own), *factor)).collect()),
        }
    }
}
