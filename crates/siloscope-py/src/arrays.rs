//! Arrays of any layout as slices, and results as arrays.

use crate::convert::value_error;
use numpy::ndarray::Dimension;
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope::geometry::parameters::{Information, PARAMETERS};
use std::borrow::Cow;

/// Entries of an array row by row: borrowed where they lie so, copied from strided, Fortran-ordered and unaligned arrays.
pub fn in_c_order<'a, T: Element + Copy, D: Dimension>(array: &'a PyReadonlyArray<'_, T, D>) -> PyResult<Cow<'a, [T]>> {
    if !array.is_empty() && !array.is_aligned() {
        let copy = array.as_any().call_method0("copy")?; // by rows, and aligned
        return Ok(Cow::Owned(copy.cast::<PyArray<T, D>>()?.to_vec()?));
    }
    match array.as_slice() {
        Ok(entries) if array.is_c_contiguous() => Ok(Cow::Borrowed(entries)),
        _ => Ok(Cow::Owned(array.as_array().iter().copied().collect())),
    }
}

/// Entries of an array (N, 3), row by row.
pub fn rows_of_three<'a, T: Element + Copy>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<Cow<'a, [T]>> {
    match array.shape() {
        [_, 3] => in_c_order(array),
        shape => Err(value_error(format!("points have shape {shape:?}, expected (N, 3)"))),
    }
}

/// Rows of an array (N, 3).
pub fn points<T: Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Vec<[T; 3]>> {
    Ok(rows_of_three(array)?.as_chunks::<3>().0.to_vec())
}

/// Vectors as an array (N, 3).
pub fn vectors<'py>(py: Python<'py>, vectors: &[Vec3]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    rows(py, &vectors.iter().map(|v| [v.x, v.y, v.z]).collect::<Vec<_>>())
}

/// Rows as an array (N, 3).
pub fn rows<'py>(py: Python<'py>, rows: &[[f64; 3]]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), 3])
}

/// A matrix over the parameters as an array (12, 12).
pub fn matrix<'py>(py: Python<'py>, m: &Information) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, m.transpose().as_slice()).reshape([PARAMETERS, PARAMETERS])
}
