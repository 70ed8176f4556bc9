//! Depth arrays of any type as float32 metres.

use crate::convert::value_error;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Raw 16-bit depth that means "no measurement".
const SENTINEL: u16 = u16::MAX;

/// Depth (H, W) of uint16, float32 or float64 times `unit` as float32 metres, C-contiguous, 0 where there is no
/// measurement; and whether any pixel has one.
#[pyfunction]
fn depth_metres<'py>(
    py: Python<'py>,
    depth: &Bound<'py, PyAny>,
    unit: f64,
) -> PyResult<(Bound<'py, PyArray2<f32>>, bool)> {
    let unit = unit as f32;
    if let Ok(raw) = depth.extract::<PyReadonlyArray2<'py, u16>>() {
        return converted(py, &raw, |&z| if z == SENTINEL { 0.0 } else { f32::from(z) * unit });
    }
    let known = move |z: f32| if z > 0.0 && z < f32::INFINITY { z * unit } else { 0.0 };
    if let Ok(single) = depth.extract::<PyReadonlyArray2<'py, f32>>() {
        return converted(py, &single, |&z| known(z));
    }
    let double: PyReadonlyArray2<'py, f64> = depth.extract().map_err(value_error)?;
    converted(py, &double, |&z| known(z as f32))
}

fn converted<'py, T: Element + Sync>(
    py: Python<'py>,
    depth: &PyReadonlyArray2<'py, T>,
    metres: impl Fn(&T) -> f32 + Sync,
) -> PyResult<(Bound<'py, PyArray2<f32>>, bool)> {
    let shape = [depth.shape()[0], depth.shape()[1]];
    let array = depth.as_array();
    let values: Vec<f32> = match array.as_slice() {
        Some(slice) => py.detach(|| slice.iter().map(&metres).collect()),
        None => array.iter().map(&metres).collect(),
    };
    let valid = values.iter().any(|&z| z > 0.0);
    Ok((PyArray1::from_vec(py, values).reshape(shape)?, valid))
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(depth_metres, m)?)
}
