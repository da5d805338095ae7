//! Axes with round numbers on them, and numbers with sensible digits.

/// Whether a value can have a place on an axis.
fn is_drawable(value: f64) -> bool {
    value.abs() < 1e100
}

/// One axis of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// What is on it, with its unit.
    pub label: String,
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl Axis {
    /// From `low` to `high` as they are.
    pub fn new(label: &str, low: f64, high: f64) -> Self {
        // What cannot be told apart in double precision has no place on an axis either.
        let (low, high) = if is_drawable(low) && is_drawable(high) { (low, high) } else { (0.0, 1.0) };
        let smallest = (1e-9 * low.abs().max(high.abs())).max(1e-99);
        let high = if high - low > smallest { high } else { low + smallest.max(1.0) };
        Self { label: label.into(), low, high }
    }

    /// Wide enough for all finite `values`, with a little room and round ends.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.into_iter().filter(|value| is_drawable(*value)) {
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            return Self::new(label, 0.0, 1.0);
        }
        if high - low < 1e-9 * high.abs().max(1e-9) {
            let room = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
            return Self::new(label, low - room, high + room);
        }
        let room = 0.04 * (high - low);
        let step = step(high - low) / 2.0;
        let (low, high) = (((low - room) / step).floor() * step, ((high + room) / step).ceil() * step);
        Self::new(label, low, high)
    }

    /// From zero to the largest of `values`, which are not negative, with a little room.
    pub fn from_zero(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        Self { low: 0.0, ..Self::around(label, values.into_iter().chain([0.0])) }
    }

    /// Where its ticks are.
    pub fn ticks(&self) -> Vec<f64> {
        let step = step(self.high - self.low);
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        (first..=last).map(|tick| tick as f64 * step).collect()
    }

    /// A tick's number, with as many decimals as the ticks differ in.
    pub fn tick_label(&self, tick: f64) -> String {
        let step = step(self.high - self.low);
        let decimals = (-step.log10()).ceil().clamp(0.0, 9.0) as usize;
        minus(&format!("{:.decimals$}", if tick.abs() < step / 2.0 { 0.0 } else { tick }))
    }

    /// The place of a value as a part of the axis.
    pub fn place(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// 1, 2 or 5 times a power of ten, so that four to eight steps make the range.
fn step(range: f64) -> f64 {
    let raw = range / 5.0;
    let power = 10f64.powf(raw.log10().floor());
    let part = raw / power;
    power
        * if part < 1.5 {
            1.0
        } else if part < 3.5 {
            2.0
        } else if part < 7.5 {
            5.0
        } else {
            10.0
        }
}

/// The hyphen of a negative number as a minus sign.
pub fn minus(text: &str) -> String {
    text.replacen('-', "\u{2212}", usize::from(text.starts_with('-')))
}

/// A number with `digits` significant digits, without an exponent where that is readable.
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let power = value.abs().log10().floor() as i32;
    if !(-4..7).contains(&power) {
        return minus(&format!("{:.*e}", (digits - 1).max(0) as usize, value));
    }
    minus(&format!("{:.*}", (digits - 1 - power).max(0) as usize, value))
}

/// A p-value with its sign: `= 0.034`, or `< 0.0001` where more digits say nothing.
pub fn p_value(p: f64) -> String {
    if p < 1e-4 { "< 0.0001".into() } else { format!("= {}", significant(p, 2)) }
}

/// A time in ms, without digits that say nothing.
pub fn milliseconds(seconds: f64) -> String {
    let rounded = (seconds * 1e5).round() / 100.0;
    minus(&format!("{rounded}"))
}

/// Mean and standard deviation with the digits that the latter warrants: two of its own.
pub fn with_spread(mean: f64, sd: f64) -> (String, String) {
    if !(sd > 0.0 && sd.is_finite()) {
        return (significant(mean, 3), significant(sd, 2));
    }
    let decimals = (1 - sd.log10().floor() as i32).clamp(0, 9) as usize;
    (minus(&format!("{mean:.decimals$}")), format!("{sd:.decimals$}"))
}

/// Text made safe for HTML and SVG.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            // Not allowed in SVG, which is XML.
            control if control.is_control() && control != '\n' && control != '\t' => safe.push('\u{fffd}'),
            other => safe.push(other),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(
            Axis::new("time (ms)", -10.0, 60.0).ticks(),
            [-10.0, 0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
        );
        assert_eq!(Axis::new("x", 0.0, 0.05).tick_label(0.02), "0.02");
        assert_eq!(Axis::new("x", -5.0, 5.0).tick_label(-2.0), "\u{2212}2");
    }

    #[test]
    fn an_axis_of_one_value_or_of_none_can_be_drawn() {
        for axis in [Axis::around("x", [3.0]), Axis::around("x", [f64::NAN]), Axis::around("x", [0.0, 0.0])] {
            assert!(axis.high > axis.low && axis.ticks().len() >= 2, "{axis:?}");
        }
    }

    #[test]
    fn an_axis_from_zero_has_no_room_below_it() {
        let axis = Axis::from_zero("subjects in each group", [3.0, 40.0]);
        assert!(axis.low == 0.0 && axis.high >= 40.0, "{axis:?}");
        assert!(Axis::around("subjects", [0.0, 3.0, 40.0]).low < 0.0, "the other kind has");
    }

    #[test]
    fn numbers_have_the_digits_they_deserve() {
        assert_eq!(with_spread(15.512, 0.98), ("15.51".into(), "0.98".into()));
        assert_eq!(with_spread(305.2, 13.2), ("305".into(), "13".into()));
        assert_eq!(with_spread(4.71e-5, 1.2e-6), ("0.0000471".into(), "0.0000012".into()));
        assert_eq!(significant(0.012345, 3), "0.0123");
        assert_eq!(significant(-1234.6, 3), "\u{2212}1235");
        assert_eq!(significant(f64::NAN, 3), "–");
    }

    #[test]
    fn text_from_files_cannot_become_markup() {
        assert_eq!(escape("<a href=\"x\">&'\u{1}"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;\u{fffd}");
    }
}
