//! Layout of the terminal: torque against its band, muscles, gate, trials, log.

use ratatui_core::layout::{Constraint, Layout, Rect};
use ratatui_core::style::{Color, Modifier, Style};
use ratatui_core::terminal::Frame;
use ratatui_core::text::{Line, Span, Text};
use ratatui_widgets::block::Block;
use ratatui_widgets::borders::Borders;
use ratatui_widgets::paragraph::{Paragraph, Wrap};
use ratatui_widgets::table::{Row, Table};
use serde_json::Value;

use super::keys::KeyInput;
use crate::console::snapshot::{Instruction, Snapshot};
use crate::console::welcome::SessionInfo;

/// Length of the torque bar as a multiple of the target.
const BAR_END: f64 = 1.25;

const GREEN: Style = Style::new().fg(Color::Green);
const SOFT: Style = Style::new().fg(Color::DarkGray);
const WARN: Style = Style::new().fg(Color::Yellow);

/// Draws the whole screen.
pub fn draw(frame: &mut Frame, snapshot: &Snapshot, history: &str, info: &SessionInfo, input: &KeyInput) {
    let history: Value = serde_json::from_str(history).unwrap_or_default();
    let question = question(snapshot, input);
    let width = usize::from(frame.area().width).max(1);
    // Words are not broken, so that a line is not always full.
    let question_lines = (question.width() * 10 / 9).div_ceil(width).max(2);
    let [head, bars, lists, foot] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(6),
        Constraint::Min(4),
        Constraint::Length(u16::try_from(question_lines).unwrap_or(2)),
    ])
    .areas(frame.area());
    frame.render_widget(heading(snapshot, info), head);
    frame.render_widget(Text::from(bar_lines(snapshot, usize::from(bars.width))), bars);
    let [left, right] = Layout::horizontal([Constraint::Length(64), Constraint::Min(14)]).areas(lists);
    trials(frame, left, &history);
    log(frame, right, &history);
    frame.render_widget(Paragraph::new(question).wrap(Wrap { trim: true }), foot);
}

fn heading<'a>(snapshot: &Snapshot, info: &'a SessionInfo) -> Text<'a> {
    let phase = Span::styled(snapshot.phase.name(), Style::new().add_modifier(Modifier::BOLD));
    let rest = snapshot.subject.rest_left_s.map_or(String::new(), |left_s| format!("  {left_s:.0} s"));
    let trial = snapshot.trial.map_or(String::new(), |trial| {
        let kind = if trial.practice { "practice" } else { "trial" };
        format!("  {kind} {} at {} rad/s", trial.number, trial.velocity_rad_s)
    });
    let left =
        snapshot.time_left_s.map_or(String::new(), |left_s| format!(", about {} left", minutes(left_s)));
    let done = format!("  {} of {} done{left}", snapshot.subject.done, snapshot.subject.total);
    let rig_trials = snapshot.rig_trials.as_ref().map_or(String::new(), |own| {
        let current = own.current.as_ref().map_or(String::new(), |current| format!(" ({current})"));
        format!("  rig trials {} of {}{current}", own.done, own.total)
    });
    let pause = Span::styled(if snapshot.pause_requested { "  pause comes" } else { "" }, WARN);
    Text::from(vec![
        Line::from(format!("{} · {} · {}", info.subject, info.protocol, info.folder)),
        Line::from(vec![phase, rest.into(), trial.into(), rig_trials.into(), done.into(), pause]),
    ])
}

/// A time in whole minutes, or in seconds if it is shorter than one.
fn minutes(time_s: f64) -> String {
    if time_s < 60.0 { format!("{time_s:.0} s") } else { format!("{:.0} min", time_s / 60.0) }
}

fn bar_lines<'a>(snapshot: &Snapshot, width: usize) -> Vec<Line<'a>> {
    let shown = &snapshot.subject;
    let room = width.saturating_sub(14).max(10);
    let asks = matches!(shown.instruction, Instruction::Target | Instruction::Stay | Instruction::Moving);
    let in_band = asks && (shown.level - 1.0).abs() < shown.band_fraction;
    let torque = snapshot.target_nm.map_or(format!("{:6.2} N m", snapshot.torque_nm), |target_nm| {
        format!("{:6.2} N m of {target_nm}", snapshot.torque_nm)
    });
    let band = asks.then_some([1.0 - shown.band_fraction, 1.0 + shown.band_fraction]);
    let style = if in_band { GREEN } else { Style::new() };
    let named = |name: &'static str, line: Vec<Span<'a>>| {
        Line::from([vec![Span::raw(format!("{name:>7} "))], line].concat())
    };
    let mut lines = vec![
        Line::from(""),
        named(
            "torque",
            bar(shown.level / BAR_END, band.map(|edges| edges.map(|edge| edge / BAR_END)), room, style),
        ),
        named("", vec![Span::raw(torque)]),
        named("gate", bar(shown.gate, None, room, GREEN)),
    ];
    // A muscle that is not measured has no bar: an empty one would say that it is silent.
    for (name, level) in ["FCR", "ECR"].into_iter().zip(shown.emg_mvc) {
        lines.extend(level.map(|level| named(name, bar(level, None, room, SOFT))));
    }
    lines
}

/// A bar of a fraction of the room, with a band drawn into it.
fn bar<'a>(fraction: f64, band: Option<[f64; 2]>, room: usize, style: Style) -> Vec<Span<'a>> {
    let cell = |fraction: f64| (fraction.clamp(0.0, 1.0) * room as f64).round() as usize;
    let (filled, band) = (cell(fraction), band.map(|edges| edges.map(cell)));
    let spans = (0..room).map(|at| match band {
        // A band narrower than a cell is still a cell wide.
        Some([low, high]) if (low..=high.max(low)).contains(&at) => {
            Span::styled(if at < filled { "█" } else { "│" }, GREEN)
        }
        _ if at < filled => Span::styled("█", style),
        _ => Span::styled("·", SOFT),
    });
    spans.collect()
}

fn trials(frame: &mut Frame, area: Rect, history: &Value) {
    let number =
        |trial: &Value, name: &str| trial[name].as_f64().map_or(String::new(), |value| value.to_string());
    let shown = |trial: &Value, name: &str| trial["shown"][name].as_str().unwrap_or("").to_owned();
    let row = |trial: &Value| {
        let status = trial["status"].as_str().unwrap_or("under way").to_owned();
        let style = match status.as_str() {
            "ok" => GREEN,
            "under way" => Style::new().add_modifier(Modifier::BOLD),
            _ => WARN,
        };
        let name = if trial["practice"] == true { "practice " } else { "" };
        Row::new([
            format!("{name}{}", trial["number"]),
            number(trial, "velocity_rad_s"),
            number(trial, "torque_nm"),
            status,
            shown(trial, "k_srs_nm_per_rad"),
            shown(trial, "x_e_rad"),
            shown(trial, "vaf"),
        ])
        .style(style)
    };
    let all = history["trials"].as_array().map_or(&[][..], Vec::as_slice);
    let room = usize::from(area.height.saturating_sub(2));
    let rows = all.iter().skip(all.len().saturating_sub(room)).map(row);
    let widths = [4, 5, 5, 9, 13, 13, 6].map(Constraint::Length);
    let head = Row::new(["", "rad/s", "N m", "", "k_srs N m/rad", "x_e mrad", "VAF"]).style(SOFT);
    let marked = all.iter().any(|trial| trial["shown"].to_string().contains('*'));
    let mark = if marked { "; * at its bound, not averaged" } else { "" };
    let title = format!("trials ± standard error{mark}");
    let block = Block::new().borders(Borders::TOP).title(title);
    frame.render_widget(Table::new(rows, widths).header(head).block(block), area);
}

fn log(frame: &mut Frame, area: Rect, history: &Value) {
    let gauges = &history["gauges"];
    let load =
        gauges["bus_load"].as_f64().map_or(String::new(), |load| format!(", bus {:.0} %", load * 100.0));
    let disk = gauges["disk_free_bytes"]
        .as_f64()
        .map_or(String::new(), |free| format!(", disk {:.1} GB", free / 1e9));
    let title = format!(
        "alarms {}, late by {} us at most, {} missed{load}{disk}",
        gauges["alarms"].as_u64().unwrap_or(0),
        gauges["latest_us"],
        gauges["missed"]
    );
    let line = |line: &Value| {
        let style = match line["kind"].as_str() {
            Some("alarm") => Style::new().fg(Color::Red),
            Some("refused") => WARN,
            Some("note" | "said") => GREEN,
            _ => Style::new(),
        };
        let text =
            format!("{:7.1} {}", line["t_s"].as_f64().unwrap_or(0.0), line["text"].as_str().unwrap_or(""));
        Line::styled(text, style)
    };
    let all = history["log"].as_array().map_or(&[][..], Vec::as_slice);
    let room = usize::from(area.height.saturating_sub(1));
    let lines: Vec<Line> = all.iter().skip(all.len().saturating_sub(room)).map(line).collect();
    let block = Block::new().borders(Borders::TOP | Borders::LEFT).title(title);
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }).block(block), area);
}

fn question<'a>(snapshot: &Snapshot, input: &'a KeyInput) -> Text<'a> {
    match input {
        KeyInput::Confirming(command) => {
            let question = snapshot.questions.get(command.name()).map_or("Sure?", String::as_str);
            Line::styled(format!("{question} Enter or y; any other key: no"), WARN).into()
        }
        KeyInput::ConfirmingStop => {
            Line::styled("End the session now? Ctrl-C again, Enter or y; any other key: no", WARN).into()
        }
        KeyInput::Writing(text) => Line::from(format!("note: {text}▏ (Enter keeps it, Esc does not)")).into(),
        KeyInput::Idle => {
            let keys = [
                ("s", "start", "start"),
                ("s", "arm again", "rearm"),
                ("space", "pause", "pause"),
                ("space", "go on", "resume"),
                ("k", "skip", "skip"),
                ("b", "one more effort", "repeat_effort"),
                ("b", "repeat the last", "repeat"),
                ("x", "end the session", "abort"),
            ];
            let possible = keys.iter().filter(|(_, _, command)| snapshot.possible.contains(command));
            let own = possible.map(|(key, what, _)| format!("{key} {what}   ")).collect::<String>();
            let commands = Line::styled(format!("{own}e pause after the trial   n note"), SOFT);
            let instruction = snapshot.rig_trials.as_ref().and_then(|own| own.instruction.as_ref());
            let instruction = instruction.map(|instruction| Line::styled(instruction.clone(), GREEN));
            Text::from_iter(instruction.into_iter().chain([commands]))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui_core::backend::TestBackend;
    use ratatui_core::terminal::Terminal;
    use serde_json::json;

    fn drawn(snapshot: &Snapshot, input: &KeyInput) -> String {
        let info = SessionInfo {
            protocol: "a first look".to_owned(),
            subject: "V00".to_owned(),
            folder: "sessions/first".to_owned(),
            rig: "virtual wrist".to_owned(),
        };
        let shown = json!({ "k_srs_nm_per_rad": "22.71 ± 0.42", "x_e_rad": "45.2*", "vaf": "0.9981" });
        let history = json!({
            "trials": [
                { "number": 1, "velocity_rad_s": 3.25, "torque_nm": 2.1, "status": "ok", "shown": shown },
                { "number": 2, "velocity_rad_s": 1.3, "torque_nm": 0.9 },
            ],
            "log": [{ "t_s": 12.34, "kind": "note", "text": "electrode re-glued" }],
            "gauges": { "alarms": 3, "latest_us": 812, "missed": 0, "bus_load": 0.31, "disk_free_bytes": 6.2e10 },
        });
        let mut screen = Terminal::new(TestBackend::new(130, 20)).unwrap();
        screen.draw(|frame| draw(frame, snapshot, &history.to_string(), &info, input)).unwrap();
        screen.backend().to_string()
    }

    fn held(level: f64) -> Snapshot {
        let mut snapshot = Snapshot::before_start(None);
        snapshot.subject.instruction = Instruction::Target;
        (snapshot.subject.level, snapshot.subject.band_fraction, snapshot.subject.gate) = (level, 0.025, 0.5);
        (snapshot.torque_nm, snapshot.target_nm) = (0.9 * level, Some(0.9));
        snapshot.possible = vec!["pause", "abort"];
        snapshot
    }

    #[test]
    fn torque_gate_trials_and_log_are_on_the_screen() {
        let picture = drawn(&held(0.5), &KeyInput::Idle);
        for part in [
            "V00 · a first look",
            "0.45 N m of 0.9",
            "k_srs N m/rad",
            "22.71 ± 0.42",
            "45.2*",
            "0.9981",
            "not averaged",
            "under way",
            "12.3 electrode re-glued",
        ] {
            assert!(picture.contains(part), "{part} is not in\n{picture}");
        }
        for part in [
            "alarms 3, late by 812 us at most, 0 missed, bus 31 %, disk 62.0",
            "space pause",
            "x end the session",
        ] {
            assert!(picture.contains(part), "{part} is not in\n{picture}");
        }
        assert!(!picture.contains("k skip"), "what is not possible is offered");
    }

    #[test]
    fn the_bar_reaches_its_band_when_the_torque_does() {
        let line = |level: f64| {
            let picture = drawn(&held(level), &KeyInput::Idle);
            let line = picture.lines().find(|line| line.contains("torque")).unwrap().to_owned();
            (line.matches('█').count(), line.matches('│').count())
        };
        let ((half, _), (whole, _), (over, edges)) = (line(0.5), line(1.0), line(1.2));
        // 116 cells of which the target is at four fifths.
        assert_eq!(half, 46);
        assert!((91..=95).contains(&whole), "{whole}");
        assert!(over > 110 && edges == 0, "{over} cells, {edges} of the band in front");
        assert!(line(0.5).1 >= 3, "the band is not drawn");
    }

    #[test]
    fn what_is_asked_is_on_the_last_line() {
        assert!(
            drawn(&held(1.0), &KeyInput::Confirming(crate::session::Event::Abort)).contains("Sure? Enter")
        );
        let mut before_arming = held(1.0);
        let long = "The motor will move the handle, with the subject's hand in it. ".repeat(4);
        before_arming.questions.insert("start", long + "Ready?");
        let asked = drawn(&before_arming, &KeyInput::Confirming(crate::session::Event::Start));
        let words: Vec<&str> = asked.split(['"', ' ', '\n']).filter(|word| !word.is_empty()).collect();
        assert!(words.join(" ").ends_with("Ready? Enter or y; any other key: no"), "it is cut:\n{asked}");
    }
}
