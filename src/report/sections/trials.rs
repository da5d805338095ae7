//! Every trial, one at a time.

use super::Section;
use crate::report::figures;
use crate::report::fitted::condition_name;
use crate::report::material::Material;
use crate::report::scale::escape;

/// So many trials are in the page; beyond, it would become too long to open at once.
const MOST: usize = 120;

/// The picker and a figure for each trial.
pub fn trials(material: &Material) -> Section {
    let mut section = Section::new("trials", "Trials (Fig. 4 of the paper)");
    if material.traces.is_empty() {
        section.absent("No trial can be drawn; the reasons are said above.");
        return section;
    }
    let window_s = material.window_s();
    let shown = &material.traces[..material.traces.len().min(MOST)];
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
    for (index, trace) in material.traces.iter().enumerate() {
        let figure = figures::trial(trace, window_s);
        if index < MOST {
            let hidden = if index == 0 { "" } else { " hidden" };
            section.html += &format!("<div class=\"trial\"{hidden}>{}</div>", figure.html());
        }
        section.figures.push(figure);
    }
    if material.traces.len() > MOST {
        section.absent(&format!(
            "The page shows the first {MOST} of {} trials by condition; the folder figures/ has them all.",
            material.traces.len()
        ));
    }
    section
}
