//! Rays and back-projection.

use crate::convert;
use numpy::{PyArray2, PyArrayMethods};
use pyo3::prelude::*;

/// Rays `(x/z, y/z)` of all pixels of a `siloscope.Camera`, undistorted: float64 array (H*W, 2), row by row.
#[pyfunction]
fn camera_rays<'py>(py: Python<'py>, camera: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let camera = convert::camera(camera)?;
    let flat: Vec<f64> = py.detach(|| camera.rays().into_iter().flatten().collect());
    numpy::PyArray1::from_vec(py, flat).reshape([camera.width * camera.height, 2])
}

/// Raises `ValueError` naming the field where a `siloscope.Camera` can't be used.
#[pyfunction]
fn check_camera(camera: &Bound<'_, PyAny>) -> PyResult<()> {
    convert::camera(camera).map(|_| ())
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(camera_rays, m)?)?;
    m.add_function(wrap_pyfunction!(check_camera, m)?)
}
