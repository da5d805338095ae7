//! The native part of the Python package `ramphold`: sessions, fits, diagnoses, simulations and studies of the crate, on NumPy arrays.
//!
//! It holds no model of its own. Results cross as the text of fit.json and diagnosis.json, which the program writes too, and as
//! arrays. What is a matter of Python (frames, figures, defaults) is in `python/ramphold`.

mod arrays;
mod background;
mod calibration;
mod command;
mod errors;
mod fitted;
mod motion;
mod protocol;
mod rig_trials;
mod session;
mod signals;
mod study;

use pyo3::prelude::*;

/// The native part of the package.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("BASE_PARAMETERS", ramphold::wrist::BASE_PARAMETERS.to_vec())?;
    module.add("EXAMPLES", std::collections::BTreeMap::from(ramphold::protocol::EXAMPLES))?;
    module.add("VERSION", ramphold::cli::VERSION)?;
    module.add_class::<session::NativeSession>()?;
    module.add_class::<fitted::NativeFit>()?;
    module.add_class::<motion::NativeMotion>()?;
    module.add_class::<protocol::NativeProtocol>()?;
    module.add_class::<rig_trials::NativeRigTrials>()?;
    module.add_class::<study::NativeStudy>()?;
    module.add_function(wrap_pyfunction!(calibration::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(calibration::check_calibration, module)?)?;
    module.add_function(wrap_pyfunction!(calibration::compare_calibration, module)?)?;
    module.add_function(wrap_pyfunction!(motion::catalogue, module)?)?;
    module.add_function(wrap_pyfunction!(motion::spline_basis, module)?)?;
    module.add_function(wrap_pyfunction!(command::command, module)?)
}
