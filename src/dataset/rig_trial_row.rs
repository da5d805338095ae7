//! What the row of a rig trial says of its load and motion, whether it is read from `rig-trials.csv` or given by a program.

use super::csv_input::CsvTable;
use super::error::DatasetError;
use crate::protocol::RigLoad;

/// What the motor does in a rig trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigTrialMotion {
    /// It holds the start position.
    Still,
    /// A ramp of the protocol, its hold and the way back.
    Ramp {
        /// Velocity, rad/s; negative turns the other way.
        velocity_rad_s: f64,
    },
    /// A sum of sines.
    Multisine,
}

impl RigTrialMotion {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Still => "still",
            Self::Ramp { .. } => "ramp",
            Self::Multisine => "multisine",
        }
    }

    /// Velocity of a ramp, rad/s.
    pub fn velocity_rad_s(self) -> Option<f64> {
        match self {
            Self::Ramp { velocity_rad_s } => Some(velocity_rad_s),
            Self::Still | Self::Multisine => None,
        }
    }
}

/// Columns that belong to some loads or motions only.
pub(super) const COLUMNS_OF_SOME: [&str; 7] =
    ["velocity_rad_s", "sign", "mass_kg", "arm_m", "inertia_kg_m2", "stiffness_nm_per_rad", "relative_error"];

/// The cells of a row by the names of their columns.
pub(super) trait RigTrialCells {
    /// The text of a cell; empty if there is none.
    fn cell(&self, column: &str) -> &str;

    /// The error for a cell that is not as `expected`.
    fn unexpected(&self, column: &str, expected: &str) -> DatasetError;
}

/// The present row of a table.
impl RigTrialCells for CsvTable<'_> {
    fn cell(&self, column: &str) -> &str {
        self.find(column).map_or("", |place| self.text(place))
    }

    fn unexpected(&self, column: &str, expected: &str) -> DatasetError {
        self.column(column).map_or_else(|missing| missing, |place| self.invalid(place, expected))
    }
}

/// Load and motion of a row; the cells that neither has must be empty.
///
/// # Errors
/// The first cell that is wrong.
pub(super) fn load_and_motion(cells: &impl RigTrialCells) -> Result<(RigLoad, RigTrialMotion), DatasetError> {
    let mut row = RigTrialRow { cells, used: [false; COLUMNS_OF_SOME.len()] };
    let motion = row.motion()?;
    let load = row.load()?;
    row.check_others_empty()?;
    Ok((load, motion))
}

/// A row, and which of the cells that belong to some loads or motions only were asked for.
struct RigTrialRow<'a, C> {
    cells: &'a C,
    used: [bool; COLUMNS_OF_SOME.len()],
}

impl<C: RigTrialCells> RigTrialRow<'_, C> {
    fn motion(&mut self) -> Result<RigTrialMotion, DatasetError> {
        match self.cells.cell("motion") {
            "still" => Ok(RigTrialMotion::Still),
            "multisine" => Ok(RigTrialMotion::Multisine),
            "ramp" => {
                let is_velocity = |value: f64| value != 0.0;
                let velocity_rad_s =
                    self.number("velocity_rad_s", is_velocity, "a velocity in rad/s other than 0")?;
                Ok(RigTrialMotion::Ramp { velocity_rad_s })
            }
            _ => Err(self.cells.unexpected("motion", "still, ramp or multisine")),
        }
    }

    fn load(&mut self) -> Result<RigLoad, DatasetError> {
        let positive = |value: f64| value > 0.0;
        match self.cells.cell("load") {
            "empty_handle" => Ok(RigLoad::EmptyHandle),
            "clamped_handle" => Ok(RigLoad::ClampedHandle),
            "known_weight" => Ok(RigLoad::KnownWeight {
                mass_kg: self.number("mass_kg", positive, "a mass in kg above 0")?,
                arm_m: self.number("arm_m", positive, "a lever arm in m above 0")?,
                sign: if self.number("sign", |value| value.abs() == 1.0, "1 or -1")? > 0.0 { 1 } else { -1 },
                relative_error: self.relative_error()?,
            }),
            "known_inertia" => Ok(RigLoad::KnownInertia {
                inertia_kg_m2: self.number("inertia_kg_m2", positive, "an inertia in kg m2 above 0")?,
                relative_error: self.relative_error()?,
            }),
            "known_spring" => Ok(RigLoad::KnownSpring {
                stiffness_nm_per_rad: self.number(
                    "stiffness_nm_per_rad",
                    positive,
                    "a stiffness in N m/rad above 0",
                )?,
                relative_error: self.relative_error()?,
            }),
            _ => {
                let expected = "empty_handle, known_weight, known_inertia, clamped_handle or known_spring";
                Err(self.cells.unexpected("load", expected))
            }
        }
    }

    fn relative_error(&mut self) -> Result<f64, DatasetError> {
        let expected =
            "the standard deviation of the stated value as a part of it, above 0 and below 1 (0.01 for 1 %)";
        self.number("relative_error", |value| value > 0.0 && value < 1.0, expected)
    }

    fn number(&mut self, column: &str, good: fn(f64) -> bool, expected: &str) -> Result<f64, DatasetError> {
        let place = COLUMNS_OF_SOME.iter().position(|own| *own == column).unwrap_or_default();
        self.used[place] = true;
        match self.cells.cell(column).parse::<f64>() {
            Ok(value) if value.is_finite() && good(value) => Ok(value),
            _ => Err(self.cells.unexpected(column, expected)),
        }
    }

    fn check_others_empty(&self) -> Result<(), DatasetError> {
        for (column, used) in COLUMNS_OF_SOME.into_iter().zip(self.used) {
            if !used && !self.cells.cell(column).is_empty() {
                let expected = "an empty cell: this load or motion has no such value";
                return Err(self.cells.unexpected(column, expected));
            }
        }
        Ok(())
    }
}
