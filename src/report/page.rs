//! The HTML page: one file with its style and script, which needs no network.

use data_encoding::BASE64;
use sha2::{Digest, Sha256};

use super::figure;
use super::input::ReportInput;
use super::scale::escape;
use super::sections::ReportSection;
use crate::dataset::PROGRAM;

const PAGE_STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// What stands at the head of a page.
#[derive(Debug)]
pub struct PageHead {
    /// Title of the document.
    pub title: String,
    /// Heading of the page.
    pub heading: String,
}

impl PageHead {
    /// That of the report of a session.
    pub fn of_session(input: &ReportInput) -> Self {
        let subject = &input.session.subject.id;
        let protocol = input.protocol.as_ref().map_or(String::new(), |own| format!(" · {}", own.name));
        Self { title: format!("{subject}: ramp-and-hold report"), heading: format!("{subject}{protocol}") }
    }
}

/// Combines the sections into the page.
pub fn html(head: &PageHead, sections: &[ReportSection]) -> String {
    let (title, heading) = (escape(&head.title), escape(&head.heading));
    // Only what is written here is a style or a script of the page. Whatever else a session's texts may bring in is neither.
    let style = format!("\n{}{PAGE_STYLE}", figure::STYLE);
    let script = format!("\n{SCRIPT}");
    let policy = format!(
        "default-src 'none'; style-src '{}'; script-src '{}'; base-uri 'none'; form-action 'none'",
        source_of(&style),
        source_of(&script)
    );
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">\
         <meta name=\"generator\" content=\"{PROGRAM}\"><title>{title}</title>\
         <style>{style}</style></head><body><header><h1>{heading}</h1>\
         <nav aria-label=\"sections\">"
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
        "</main><footer>Written by {PROGRAM}. Angles in mrad, times in ms; other units are SI. The figures are also in the folder figures beside this page. Paper: \
         E. de Vlugt et al., Short range stiffness elastic limit depends on joint velocity, 2011.</footer>\
         <script>{script}</script></body></html>\n"
    )
}

/// A style or a script by its sum, as a content security policy names it.
fn source_of(text: &str) -> String {
    format!("sha256-{}", BASE64.encode(&Sha256::digest(text)))
}

/// A heading without the part in brackets or after a colon.
fn short(heading: &str) -> String {
    escape(heading.split([':', '(']).next().unwrap_or(heading).trim())
}
