//! The sections of the page, in the order in which they are read.

mod diagnosis;
mod glance;
mod parameters;
mod trials;

pub use diagnosis::diagnosis;
pub use glance::glance;
pub use parameters::{balance, parameters, stiffness, uncertainty};
pub use trials::trials;

use super::figure::Figure;

/// A section: its HTML, and the figures that also become files.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Its place in the page.
    pub id: &'static str,
    /// Its heading.
    pub heading: &'static str,
    /// What is in it.
    pub html: String,
    /// Its figures.
    pub figures: Vec<Figure>,
}

impl Section {
    fn new(id: &'static str, heading: &'static str) -> Self {
        Self { id, heading, ..Self::default() }
    }

    /// Adds a figure to page and files.
    fn figure(&mut self, figure: Figure) {
        self.html += &figure.html();
        self.figures.push(figure);
    }

    /// Says that something is not there.
    fn absent(&mut self, what: &str) {
        self.html += &format!("<p class=\"absent\">{}</p>", super::scale::escape(what));
    }

    /// Adds a paragraph.
    fn say(&mut self, what: &str) {
        self.html += &format!("<p>{}</p>", super::scale::escape(what));
    }
}
