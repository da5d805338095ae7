//! Arrays of NumPy: what is taken, and what is given.

use numpy::{
    PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray1, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors::wrong_input;

/// The values of a one-dimensional, contiguous array of float64; `name` is its name in messages.
///
/// # Errors
/// If it is anything else; the message says what to do.
pub fn vector<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArray1<'py, f64>> {
    let Ok(array) = value.cast::<PyUntypedArray>() else {
        let found = value.get_type().name()?;
        return Err(wrong_input(format!("{name}: {found}; expected a NumPy array of float64")));
    };
    if array.ndim() != 1 {
        return Err(wrong_input(format!("{name}: shape {:?}; expected one dimension", array.shape())));
    }
    if !array.dtype().is_equiv_to(&numpy::dtype::<f64>(value.py())) {
        return Err(wrong_input(format!(
            "{name}: dtype {}; expected float64, native byte order (array.astype(float) converts)",
            array.dtype()
        )));
    }
    if !array.is_contiguous() {
        return Err(wrong_input(format!(
            "{name}: not contiguous; expected one value after the other in memory (numpy.ascontiguousarray copies)"
        )));
    }
    match value.cast::<PyArray1<f64>>() {
        Ok(array) => array.try_readonly().map_err(|error| wrong_input(format!("{name}: {error}"))),
        Err(error) => Err(wrong_input(format!("{name}: {error}"))),
    }
}

/// A matrix from its rows, one after the other.
pub fn matrix<'py>(py: Python<'py>, values: Vec<f64>, rows: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let columns = values.len().checked_div(rows).unwrap_or(0);
    PyArray1::from_vec(py, values).reshape([rows, columns])
}
