//! Fields of Python objects, with messages that name them.

use crate::convert::value_error;
use pyo3::prelude::*;

pub fn number(object: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    object.getattr(name)?.extract().map_err(|_| value_error(format!("{name} must be a number")))
}

pub fn numbers<const N: usize>(object: &Bound<'_, PyAny>, name: &str) -> PyResult<[f64; N]> {
    object.getattr(name)?.extract().map_err(|_| value_error(format!("{name} must be {N} numbers")))
}

pub fn whole(object: &Bound<'_, PyAny>, name: &str) -> PyResult<u32> {
    object.getattr(name)?.extract().map_err(|_| value_error(format!("{name} must be a whole number")))
}

pub fn seed(object: &Bound<'_, PyAny>, name: &str) -> PyResult<u64> {
    let message = || value_error(format!("{name} must be a whole number between 0 and 2^64 - 1"));
    object.getattr(name)?.extract().map_err(|_| message())
}
