//! The trials, one figure each.

use super::ReportSection;
use crate::report::figures;
use crate::report::fitted::condition_name;
use crate::report::input::ReportInput;
use crate::report::scale::escape;

/// Largest number of trials shown in the page; the folder of figures has all of them.
const MAX_SHOWN_TRIALS: usize = 120;

/// The section: a selector, and a figure for each trial.
pub fn trials(input: &ReportInput) -> ReportSection {
    let mut section = ReportSection::new("trials", "Trials (Fig. 4 of the paper)");
    if input.traces.is_empty() {
        section.absent("No trial can be drawn; the reasons are listed in the overview.");
        return section;
    }
    let window_s = input.window_s();
    let shown = &input.traces[..input.traces.len().min(MAX_SHOWN_TRIALS)];
    section.html += "<div class=\"picker\"><button type=\"button\" data-step=\"-1\" aria-label=\"previous trial\">◀</button>\
                     <label>Trial <select id=\"trial\">";
    for trace in shown {
        let name = condition_name(trace.label.as_ref(), trace.velocity_rad_s, trace.torque_nm);
        section.html += &format!(
            "<option value=\"trial-{:03}\">{}: {}, repetition {}</option>",
            trace.number,
            trace.number,
            escape(&name),
            trace.repetition
        );
    }
    section.html +=
        "</select></label><button type=\"button\" data-step=\"1\" aria-label=\"next trial\">▶</button></div>";
    for (index, trace) in input.traces.iter().enumerate() {
        let figure = figures::trial(trace, window_s, &input.biases);
        if index < MAX_SHOWN_TRIALS {
            let hidden = if index == 0 { "" } else { " hidden" };
            section.html += &format!("<div class=\"trial\"{hidden}>{}</div>", figure.html());
        }
        section.figures.push(figure);
    }
    if input.traces.len() > MAX_SHOWN_TRIALS {
        section.absent(&format!(
            "The page shows the first {MAX_SHOWN_TRIALS} of {} trials by condition; the folder figures/ has them all.",
            input.traces.len()
        ));
    }
    section
}
