//! The sections of the page, in the order in which they are read.

mod balance;
mod comparison;
mod diagnosis;
mod emg;
mod overview;
mod parameters;
mod rig;
mod stiffness;
mod torque_at_rest;
mod trials;
mod uncertainty;
mod values;
mod verdict;

pub use balance::balance;
pub use comparison::comparison;
pub use diagnosis::diagnosis;
pub use emg::emg;
pub use overview::overview;
pub use parameters::parameters;
pub use rig::rig;
pub use stiffness::stiffness;
pub use torque_at_rest::torque_at_rest;
pub use trials::trials;
pub use uncertainty::uncertainty;
pub use values::spread_of;
pub use verdict::verdict;

use super::figure::Figure;

/// A section: its HTML, and the figures that also become files.
#[derive(Debug, Clone, Default)]
pub struct ReportSection {
    /// Its anchor in the page.
    pub id: &'static str,
    /// Its heading.
    pub heading: &'static str,
    /// Its content as HTML.
    pub html: String,
    /// Its figures.
    pub figures: Vec<Figure>,
}

impl ReportSection {
    /// An empty section.
    pub fn new(id: &'static str, heading: &'static str) -> Self {
        Self { id, heading, ..Self::default() }
    }

    /// Adds a figure to the section and to the files.
    pub fn figure(&mut self, figure: Figure) {
        self.html += &figure.html();
        self.figures.push(figure);
    }

    /// Adds a paragraph about something that is missing.
    pub fn absent(&mut self, what: &str) {
        self.html += &format!("<p class=\"absent\">{}</p>", super::scale::escape(what));
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, what: &str) {
        self.html += &format!("<p>{}</p>", super::scale::escape(what));
    }
}
