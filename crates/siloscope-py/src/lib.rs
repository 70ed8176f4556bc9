//! Python bindings: convert, release the GIL, map errors. Nothing else.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use siloscope::geometry::parameters::NAMES;

mod arrays;
mod camera;
mod content;
mod convert;
mod depth;
mod files;
mod frame_factor;
mod fusion;
mod inputs;
mod outcome;
mod scene;
mod shape_tensor_fit;
mod six_steps;
mod steps;
mod surface;

/// The compiled core of siloscope.
#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    load_numpy(m.py())?;
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("PARAMETERS", PyTuple::new(m.py(), NAMES)?)?;
    camera::register(m)?;
    depth::register(m)?;
    content::register(m)?;
    files::register(m)?;
    frame_factor::register(m)?;
    fusion::register(m)?;
    outcome::register(m)?;
    scene::register(m)?;
    surface::register(m)?;
    steps::register(m)?;
    six_steps::register(m)?;
    Ok(())
}

/// Makes NumPy's interface known before there is work: met by an interruption later, its first use would panic.
fn load_numpy(py: Python<'_>) -> PyResult<()> {
    py.check_signals()?;
    PyArray1::<f64>::zeros(py, 0, false);
    Ok(())
}
