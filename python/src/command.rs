//! The program `ramphold`, run within Python.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program with `arguments`, the first of which is its name; returns the exit code. Once in a process.
#[pyfunction]
pub fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| ramphold::cli::run_program(arguments))
}
