//! Failures of the crate as exceptions of Python, with the text that the program prints.

use pyo3::prelude::*;
use ramphold::app::Failure;

/// The exception for a failure: `ramphold.InputError` if the input was wrong, `ramphold.WorkError` if the work failed.
pub fn exception(failure: impl Into<Failure>) -> PyErr {
    let failure = failure.into();
    let class = if failure.exit_code() == 2 { "InputError" } else { "WorkError" };
    named(class, failure.to_string())
}

/// The exception for input that is wrong, before the crate sees it.
pub fn wrong_input(message: impl Into<String>) -> PyErr {
    named("InputError", message.into())
}

/// The exception for work that failed.
pub fn failed_work(message: impl Into<String>) -> PyErr {
    named("WorkError", message.into())
}

fn named(class: &str, message: String) -> PyErr {
    Python::attach(|py| {
        let made = py
            .import("ramphold._errors")
            .and_then(|module| module.getattr(class))
            .and_then(|class| class.call1((message,)));
        match made {
            Ok(exception) => PyErr::from_value(exception),
            Err(error) => error,
        }
    })
}
