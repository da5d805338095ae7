//! The report of a session or of a study: `report.html`, one file that needs no network, and its figures as SVG.
//!
//! All content comes from the session's folder and its results. A report needs no second fit, and it lists what is
//! missing. It contains neither time nor machine, so that the same session gives the same bytes.

mod belonging;
mod bias;
mod chart;
mod derived;
mod diagnosed;
mod emg;
mod error;
mod estimate_text;
mod figure;
mod figures;
mod fitted;
mod input;
mod journal;
mod known_rig;
mod page;
mod rest_torque;
mod scale;
mod sections;
mod study;
mod table;
mod traces;

use std::path::{Path, PathBuf};

pub use emg::{TrialEmg, find_onsets, trial_emg};
pub use error::ReportError;
pub use estimate_text::MARK_MEANING;
pub use figures::{EffectCurve, PowerCurve, mechanism as mechanism_figure, power as power_figure};
pub use fitted::{SHOWN, Shown};
pub use input::{foreign_results, undescribed};

use crate::dataset::{Disk, Session};
use crate::files::Folder;
use crate::study::StudyResults;
use input::{ReportInput, read_fit};
use page::PageHead;
use sections::ReportSection;

/// File name of the page in a results folder.
pub const REPORT: &str = "report.html";

/// Name of the folder of figures in a results folder.
pub const FIGURES: &str = "figures";

/// The files that were written.
#[derive(Debug, Clone, PartialEq)]
pub struct WrittenReport {
    /// The page.
    pub page: PathBuf,
    /// Number of figures.
    pub figures: usize,
    /// What the report lacks, and the reasons.
    pub missing: Vec<String>,
}

/// Whether the fit in a folder of results, if there is one, is of the trials of `session`.
///
/// # Errors
/// If `fit.json` is there and cannot be read.
pub fn is_of_session(results: &Path, session: &Session) -> Result<bool, ReportError> {
    let unreadable = |source| ReportError::Unreadable { path: results.into(), source };
    let folder = match Folder::open(results) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(true),
        opened => opened.map_err(unreadable)?,
    };
    Ok(read_fit(&folder)?.is_none_or(|fitted| fitted.is_of(session)))
}

/// Writes the report of `session`, which was read from `folder` and whose results are in `results`, into the folder `out`; a second
/// fit, in the folder `beside`, is laid beside the first.
///
/// # Errors
/// If the session's folder, or a result file that is there, cannot be read, or the report cannot be written.
pub fn write(
    folder: &Path,
    session: Session,
    results: &Folder,
    beside: Option<&Folder>,
    out: &Folder,
    disk: &Disk,
) -> Result<WrittenReport, ReportError> {
    let input = ReportInput::read(folder, session, results, beside)?;
    let beside = input.beside.is_some().then(|| sections::comparison(&input));
    let emg = sections::emg(&input);
    let mut sections = vec![sections::verdict(&input), sections::overview(&input)];
    sections.extend(beside);
    sections.extend([sections::trials(&input), sections::parameters(&input)]);
    sections.extend([sections::balance(&input), sections::stiffness(&input)]);
    sections.extend(emg);
    sections.extend(sections::torque_at_rest(&input));
    sections.extend([sections::diagnosis(&input), sections::rig(&input), sections::uncertainty(&input)]);
    let page = write_page(&PageHead::of_session(&input), &sections, out, disk)?;
    Ok(WrittenReport { missing: input.missing, ..page })
}

/// Writes the report of the study in `folder` into the folder `out`.
///
/// # Errors
/// If the study is not finished or its files cannot be read, or the report cannot be written.
pub fn write_study(folder: &Path, out: &Folder, disk: &Disk) -> Result<WrittenReport, ReportError> {
    let results = StudyResults::read(folder)?;
    let name = results.name.clone().unwrap_or_else(|| "Study".into());
    let head = PageHead { title: format!("{name}: report of a study"), heading: name };
    write_page(&head, &study::sections(&results), out, disk)
}

/// Writes a page and its figures.
fn write_page(
    head: &PageHead,
    sections: &[ReportSection],
    out: &Folder,
    disk: &Disk,
) -> Result<WrittenReport, ReportError> {
    let at = |path: PathBuf| move |source| ReportError::Unwritable { path, source };
    let figures_folder = out.folder_made(FIGURES).map_err(at(out.path_of(FIGURES)))?;
    let mut figures = 0;
    for figure in sections.iter().flat_map(|section| &section.figures) {
        let name = format!("{}.svg", figure.id);
        disk.write(&figures_folder, &name, figure.file().as_bytes())
            .map_err(at(figures_folder.path_of(&name)))?;
        figures += 1;
    }
    let page = out.path_of(REPORT);
    disk.write(out, REPORT, page::html(head, sections).as_bytes()).map_err(at(page.clone()))?;
    Ok(WrittenReport { page, figures, missing: Vec::new() })
}
