//! Pictures and tables for a person: `report.html`, one file that opens anywhere, and its figures as SVG.
//!
//! Everything comes from the session's folder and its results: a report needs no second fit, and what is missing is
//! said in it. It holds nothing of the clock or the machine, so the same session gives the same bytes.

mod chart;
mod derived;
mod error;
mod figure;
mod figures;
mod fitted;
mod journal;
mod material;
mod page;
mod scale;
mod sections;
mod table;
mod traces;

use std::path::{Path, PathBuf};

pub use error::ReportError;
pub use figures::{EffectCurve, PowerCurve, mechanism as mechanism_figure, power as power_figure};

use crate::dataset::Disk;
use material::Material;

/// Name of the page in a results folder.
pub const REPORT: &str = "report.html";

/// Name of the folder of figures beside it.
pub const FIGURES: &str = "figures";

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The page.
    pub page: PathBuf,
    /// How many figures.
    pub figures: usize,
    /// What the report lacks, and why.
    pub missing: Vec<String>,
}

/// Writes the report of the session in `folder`, whose results are in `results`, beside those results.
///
/// # Errors
/// If the session, or a result file that is there, cannot be read, or the report cannot be written.
pub fn write(folder: &Path, results: &Path, disk: &Disk) -> Result<Written, ReportError> {
    let material = Material::read(folder, results)?;
    let sections = [
        sections::glance(&material),
        sections::trials(&material),
        sections::parameters(&material),
        sections::balance(&material),
        sections::stiffness(&material),
        sections::diagnosis(&material),
        sections::uncertainty(&material),
    ];
    let figures_folder = results.join(FIGURES);
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| ReportError::Unwritable { path, source }
    };
    std::fs::create_dir_all(&figures_folder).map_err(at(&figures_folder))?;
    let mut figures = 0;
    for figure in sections.iter().flat_map(|section| &section.figures) {
        let path = figures_folder.join(format!("{}.svg", figure.id));
        disk.write(&path, figure.file().as_bytes()).map_err(at(&path))?;
        figures += 1;
    }
    let page = results.join(REPORT);
    disk.write(&page, page::html(&material, &sections).as_bytes()).map_err(at(&page))?;
    Ok(Written { page, figures, missing: material.missing })
}
