//! Charts as SVG. They are drawn here because their colours must be CSS variables: the same figure then follows a light or
//! dark page, prints, and works as a separate file. Charting libraries write fixed colours into every shape.

use std::fmt::{Display, Write, from_fn};

use super::scale::{Axis, escape};

/// Size of a panel, in the units of its view box.
pub const WIDTH: f64 = 440.0;
/// See [`WIDTH`].
pub const HEIGHT: f64 = 290.0;

const LEFT: f64 = 56.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 44.0;
const TITLE: f64 = 24.0;
const LEGEND_LINE: f64 = 17.0;

/// Number of colours besides the text colour (0): those of Okabe and Ito, 1 to 7.
pub const COLOURS: usize = 7;

/// Line style, so that colour is not the only difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Solid.
    Solid,
    /// Dashed.
    Dashed,
    /// Thin, for measured values.
    Thin,
}

/// An element of a chart; elements are drawn from back to front.
#[derive(Debug, Clone)]
pub enum Mark {
    /// A shaded interval of the x axis.
    Window(f64, f64),
    /// A shaded interval of the y axis: reference values.
    Reference(f64, f64),
    /// A dotted vertical line with a label.
    At(f64, String),
    /// A shaded band: x, lower and upper.
    Band(usize, Vec<(f64, f64, f64)>),
    /// A line.
    Line(usize, Stroke, Vec<(f64, f64)>),
    /// Points with standard deviations, joined by a line; the shape goes with the colour.
    Points(usize, Vec<(f64, f64, Option<f64>)>),
    /// Crosses.
    Crosses(usize, Vec<(f64, f64)>),
    /// Bars from zero: left, right, height.
    Bars(usize, Vec<(f64, f64, f64)>),
}

/// The symbol of an entry of a legend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// A line.
    Line(Stroke),
    /// A point.
    Point,
    /// A cross.
    Cross,
}

/// A chart with two axes.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Its elements.
    pub marks: Vec<Mark>,
    /// Colour, symbol and text of the entries of its legend.
    pub legend: Vec<(usize, Sign, String)>,
}

/// A drawn chart.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Text alternative for screen readers.
    pub label: String,
    /// SVG inside a view box of [`WIDTH`] by [`HEIGHT`].
    pub svg: String,
}

impl Chart {
    /// Draws it.
    pub fn panel(&self) -> Panel {
        let mut svg = String::new();
        let mut line = 0.0;
        let mut x = LEFT;
        for (colour, sign, words) in &self.legend {
            let width = 26.0 + 6.1 * words.chars().count() as f64;
            if x + width > WIDTH && x > LEFT {
                (x, line) = (LEFT, line + 1.0);
            }
            self.legend_entry(&mut svg, *colour, *sign, words, (x, TITLE + LEGEND_LINE * line + 8.0));
            x += width + 8.0;
        }
        let lines = if self.legend.is_empty() { 0.0 } else { line + 1.0 };
        let top = TITLE + LEGEND_LINE * lines + 4.0;
        let _ = write!(svg, "<text class=\"title\" x=\"{LEFT}\" y=\"15\">{}</text>", escape(&self.title));
        let plot = Plot { chart: self, top, width: WIDTH - LEFT - RIGHT, height: HEIGHT - BOTTOM - top };
        plot.axes(&mut svg);
        plot.marks(&mut svg);
        let label = format!("{}: {} against {}", self.title, self.y.label, self.x.label);
        Panel { label, svg }
    }

    fn legend_entry(&self, svg: &mut String, colour: usize, sign: Sign, words: &str, (x, y): (f64, f64)) {
        let _ = match sign {
            Sign::Line(stroke) => {
                write!(svg, "<path class=\"key {} c{colour}\" d=\"M{x} {y}h18\"/>", class(stroke))
            }
            Sign::Point => {
                write!(svg, "<path class=\"dot c{colour}\" d=\"{}\"/>", shape(colour, x + 9.0, y))
            }
            Sign::Cross => {
                write!(svg, "<path class=\"key c{colour}\" d=\"M{} {}l8 8m0-8l-8 8\"/>", x + 5.0, y - 4.0)
            }
        };
        let _ = write!(
            svg,
            "<text class=\"legend\" x=\"{}\" y=\"{}\">{}</text>",
            x + 23.0,
            y + 4.0,
            escape(words)
        );
    }
}

/// The area in which the elements are drawn.
struct Plot<'a> {
    chart: &'a Chart,
    top: f64,
    width: f64,
    height: f64,
}

impl Plot<'_> {
    fn x(&self, value: f64) -> f64 {
        // Far outside is as good as farther outside, and stays a number that a browser can draw.
        self.width * self.chart.x.place(value).clamp(-20.0, 20.0)
    }

    fn y(&self, value: f64) -> f64 {
        self.height * (1.0 - self.chart.y.place(value)).clamp(-20.0, 20.0)
    }

    fn axes(&self, svg: &mut String) {
        let (bottom, right) = (self.top + self.height, LEFT + self.width);
        let _ = write!(svg, "<path class=\"grid\" d=\"");
        for tick in self.chart.y.ticks() {
            let _ = write!(svg, "M{LEFT} {:.1}h{:.1}", self.top + self.y(tick), self.width);
        }
        for tick in self.chart.x.ticks() {
            let _ = write!(svg, "M{:.1} {:.1}v{:.1}", LEFT + self.x(tick), self.top, self.height);
        }
        let _ =
            write!(svg, "\"/><path class=\"frame\" d=\"M{LEFT} {:.1}V{bottom:.1}H{right:.1}\"/>", self.top);
        for tick in self.chart.y.ticks() {
            let y = self.top + self.y(tick) + 4.0;
            let label = self.chart.y.tick_label(tick);
            let _ = write!(
                svg,
                "<text class=\"tick\" text-anchor=\"end\" x=\"{}\" y=\"{y:.1}\">{label}</text>",
                LEFT - 6.0
            );
        }
        for tick in self.chart.x.ticks() {
            let (x, label) = (LEFT + self.x(tick), self.chart.x.tick_label(tick));
            let y = bottom + 15.0;
            let _ = write!(
                svg,
                "<text class=\"tick\" text-anchor=\"middle\" x=\"{x:.1}\" y=\"{y:.1}\">{label}</text>"
            );
        }
        let (middle_x, middle_y) = (LEFT + self.width / 2.0, self.top + self.height / 2.0);
        let _ = write!(
            svg,
            "<text class=\"axis\" text-anchor=\"middle\" x=\"{middle_x:.1}\" y=\"{:.1}\">{}</text>\
             <text class=\"axis\" text-anchor=\"middle\" transform=\"translate(13 {middle_y:.1})rotate(-90)\">{}</text>",
            HEIGHT - 8.0,
            escape(&self.chart.x.label),
            escape(&self.chart.y.label)
        );
    }

    /// The marks, clipped to the plot by a view of its own.
    fn marks(&self, svg: &mut String) {
        let (top, width, height) = (self.top, self.width, self.height);
        let _ = write!(
            svg,
            "<svg class=\"plot\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\">"
        );
        for mark in &self.chart.marks {
            self.mark(svg, mark);
        }
        *svg += "</svg>";
    }

    fn mark(&self, svg: &mut String, mark: &Mark) {
        let _ = match mark {
            Mark::Window(from, to) => {
                let (x, width) = (self.x(*from), self.x(*to) - self.x(*from));
                write!(svg, "<rect class=\"window\" x=\"{x:.1}\" y=\"0\" width=\"{width:.1}\" height=\"{:.1}\"/>", self.height)
            }
            Mark::Reference(low, high) => {
                let (y, height) = (self.y(*high), (self.y(*low) - self.y(*high)).max(1.5));
                write!(svg, "<rect class=\"reference\" x=\"0\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{height:.1}\"/>", self.width)
            }
            Mark::At(at, words) => {
                let x = self.x(*at);
                let (anchor, shift) = if x > 0.7 * self.width { ("end", -4.0) } else { ("start", 4.0) };
                write!(
                    svg,
                    "<path class=\"at\" d=\"M{x:.1} 0V{:.1}\"/><text class=\"legend\" text-anchor=\"{anchor}\" x=\"{:.1}\" y=\"12\">{}</text>",
                    self.height,
                    x + shift,
                    escape(words)
                )
            }
            Mark::Band(colour, band) => {
                let upper = band.iter().map(|(x, _, high)| (*x, *high));
                let lower = band.iter().rev().map(|(x, low, _)| (*x, *low));
                let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
                write!(svg, "<path class=\"band c{colour}\" d=\"{}z\"/>", self.path(&outline))
            }
            Mark::Line(colour, stroke, points) => {
                write!(svg, "<path class=\"{} c{colour}\" d=\"{}\"/>", class(*stroke), self.path(points))
            }
            Mark::Points(colour, points) => self.points(svg, *colour, points),
            Mark::Crosses(colour, points) => points.iter().try_for_each(|(x, y)| {
                let (x, y) = (self.x(*x) - 4.0, self.y(*y) - 4.0);
                write!(svg, "<path class=\"line c{colour}\" d=\"M{x:.1} {y:.1}l8 8m0-8l-8 8\"/>")
            }),
            Mark::Bars(colour, bars) => bars.iter().try_for_each(|(left, right, height)| {
                let (x, y) = (self.x(*left), self.y(*height));
                let (width, height) = ((self.x(*right) - x - 1.0).max(1.0), self.y(0.0) - y);
                write!(
                    svg,
                    "<rect class=\"bar c{colour}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
                )
            }),
        };
    }

    fn points(
        &self,
        svg: &mut String,
        colour: usize,
        points: &[(f64, f64, Option<f64>)],
    ) -> std::fmt::Result {
        let line: Vec<(f64, f64)> = points.iter().map(|(x, y, _)| (*x, *y)).collect();
        write!(svg, "<path class=\"join c{colour}\" d=\"{}\"/>", self.path(&line))?;
        for (x, y, sd) in points.iter().filter(|(x, y, _)| x.is_finite() && y.is_finite()) {
            if let Some(sd) = sd {
                let (x, high, low) = (self.x(*x), self.y(y + sd), self.y(y - sd));
                write!(
                    svg,
                    "<path class=\"spread c{colour}\" d=\"M{:.1} {high:.1}h6m-3 0V{low:.1}m-3 0h6\"/>",
                    x - 3.0
                )?;
            }
            write!(svg, "<path class=\"dot c{colour}\" d=\"{}\"/>", shape(colour, self.x(*x), self.y(*y)))?;
        }
        Ok(())
    }

    /// A path through the points, in tenths of a unit and relative to save space; it breaks where a value is missing.
    fn path(&self, points: &[(f64, f64)]) -> String {
        let mut path = String::new();
        let mut last: Option<(i64, i64)> = None;
        for (x, y) in points {
            if !(x.is_finite() && y.is_finite()) {
                last = None;
                continue;
            }
            let here = ((self.x(*x) * 10.0).round() as i64, (self.y(*y) * 10.0).round() as i64);
            let _ = match last {
                None => write!(path, "M{} {}", tenths(here.0), tenths(here.1)),
                Some(before) if before == here => continue,
                Some(before) => write!(path, "l{} {}", tenths(here.0 - before.0), tenths(here.1 - before.1)),
            };
            last = Some(here);
        }
        path
    }
}

/// `number / 10` in as few characters as it takes.
fn tenths(number: i64) -> impl Display {
    let sign = if number < 0 { "-" } else { "" };
    let (whole, part) = (number.abs() / 10, number.abs() % 10);
    from_fn(
        move |out| if part == 0 { write!(out, "{sign}{whole}") } else { write!(out, "{sign}{whole}.{part}") },
    )
}

fn class(stroke: Stroke) -> &'static str {
    match stroke {
        Stroke::Solid => "line",
        Stroke::Dashed => "line dashed",
        Stroke::Thin => "line thin",
    }
}

/// A circle, square, triangle or diamond around a place.
fn shape(colour: usize, x: f64, y: f64) -> String {
    match colour % 4 {
        1 => format!("M{:.1} {y:.1}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z", x - 4.0),
        2 => format!("M{:.1} {:.1}h7v7h-7z", x - 3.5, y - 3.5),
        3 => format!("M{x:.1} {:.1}l4.5 8h-9z", y - 5.0),
        _ => format!("M{x:.1} {:.1}l5 5l-5 5l-5-5z", y - 5.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(marks: Vec<Mark>) -> String {
        let chart = Chart {
            title: "<torque>".into(),
            x: Axis::new("time (ms)", 0.0, 10.0),
            y: Axis::new("torque (N m)", 0.0, 1.0),
            marks,
            legend: vec![(1, Sign::Line(Stroke::Solid), "measured".into())],
        };
        chart.panel().svg
    }

    #[test]
    fn a_value_that_is_missing_breaks_the_line() {
        let svg = chart(vec![Mark::Line(1, Stroke::Solid, vec![(0.0, 0.0), (1.0, f64::NAN), (2.0, 0.0)])]);
        let path = svg.split("class=\"line c1\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        assert_eq!(path.matches('M').count(), 2, "{path}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn words_are_escaped_and_axes_have_their_units() {
        let svg = chart(Vec::new());
        assert!(svg.contains("&lt;torque&gt;") && svg.contains("time (ms)") && svg.contains("torque (N m)"));
    }
}
