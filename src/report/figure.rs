//! A figure: panels with a title and a caption, as a part of the page and as a file that stands alone.

use std::fmt::Write;

use super::chart::{HEIGHT, Panel, WIDTH};
use super::scale::escape;

/// Colours for light, dark and paper. The page and each figure's file hold it.
pub const STYLE: &str = include_str!("figure.css");

/// A figure of one or more panels.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Name of its file, and of its place in the page.
    pub id: String,
    /// Its title.
    pub title: String,
    /// Its caption.
    pub caption: String,
    /// Its panels.
    pub panels: Vec<Panel>,
    /// Number of columns in its file; the page shows as many as fit.
    pub columns: usize,
}

impl Figure {
    /// As a part of the page.
    pub fn html(&self) -> String {
        let mut html =
            format!("<figure id=\"{}\"><div class=\"panels of-{}\">", escape(&self.id), self.columns);
        for panel in &self.panels {
            let _ = write!(
                html,
                "<svg class=\"panel\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\">{}</svg>",
                escape(&panel.label),
                panel.svg
            );
        }
        let _ = write!(
            html,
            "</div><figcaption><b>{}.</b> {}</figcaption></figure>",
            escape(&self.title),
            escape(&self.caption)
        );
        html
    }

    /// As an SVG file.
    pub fn file(&self) -> String {
        let rows = self.panels.len().div_ceil(self.columns.max(1));
        let (width, height) = (WIDTH * self.columns as f64, HEIGHT * rows as f64 + 24.0);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"panel\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\"><title>{}</title><desc>{}</desc><style>{STYLE}</style>\
             <rect class=\"paper\" width=\"100%\" height=\"100%\"/>\
             <text class=\"title\" x=\"12\" y=\"17\">{}</text>",
            escape(&self.title),
            escape(&self.caption),
            escape(&self.title)
        );
        for (index, panel) in self.panels.iter().enumerate() {
            let (x, y) =
                (WIDTH * (index % self.columns) as f64, 24.0 + HEIGHT * (index / self.columns) as f64);
            let _ = write!(
                svg,
                "<svg x=\"{x}\" y=\"{y}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\">{}</svg>",
                panel.svg
            );
        }
        svg + "</svg>\n"
    }
}
