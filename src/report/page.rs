//! The HTML page: one file with its style and script, which needs no network.

use super::figure;
use super::input::ReportInput;
use super::scale::escape;
use super::sections::ReportSection;
use crate::dataset::PROGRAM;

const PAGE_STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Combines the sections into the page.
pub fn html(input: &ReportInput, sections: &[ReportSection]) -> String {
    let subject = escape(&input.session.subject.id);
    let protocol = input.protocol.as_ref().map_or(String::new(), |own| format!(" · {}", escape(&own.name)));
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <meta name=\"generator\" content=\"{PROGRAM}\"><title>{subject}: ramp-and-hold report</title>\
         <style>\n{}{PAGE_STYLE}</style></head><body><header><h1>{subject}{protocol}</h1>\
         <nav aria-label=\"sections\">",
        figure::STYLE
    );
    for section in sections {
        page += &format!("<a href=\"#{}\">{}</a>", section.id, short(section.heading));
    }
    page += "</nav></header><main>";
    for section in sections {
        page += &format!(
            "\n<section id=\"{}\"><h2>{}</h2>{}</section>",
            section.id,
            escape(section.heading),
            section.html
        );
    }
    page + &format!(
        "</main><footer>Written by {PROGRAM}. SI units. The figures are also in the folder figures beside this page. Paper: \
         E. de Vlugt et al., Short range stiffness elastic limit depends on joint velocity, 2011.</footer>\
         <script>\n{SCRIPT}</script></body></html>\n"
    )
}

/// A heading without the part in brackets or after a colon.
fn short(heading: &str) -> String {
    escape(heading.split([':', '(']).next().unwrap_or(heading).trim())
}
