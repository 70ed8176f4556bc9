//! Depth arrays of any type as float32 metres.

use crate::arrays::in_c_order;
use crate::convert::value_error;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use siloscope::geometry::equal_runs as runs;

/// Raw 16-bit depth that means "no measurement".
const SENTINEL: u16 = u16::MAX;

/// A depth image in metres.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct MetricDepth {
    /// (H, W) float32 metres, C-contiguous, 0 where there is no measurement.
    depth: Py<PyArray2<f32>>,
    /// Whether any pixel has a measurement.
    any_measured: bool,
}

/// Depth (H, W) of uint16, float32 or float64 times `unit` as float32 metres.
#[pyfunction]
fn depth_metres<'py>(py: Python<'py>, depth: &Bound<'py, PyAny>, unit: f64) -> PyResult<MetricDepth> {
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

fn converted<'py, T: Element + Copy + Sync>(
    py: Python<'py>,
    depth: &PyReadonlyArray2<'py, T>,
    metres: impl Fn(&T) -> f32 + Sync,
) -> PyResult<MetricDepth> {
    let shape = [depth.shape()[0], depth.shape()[1]];
    let entries = in_c_order(depth)?;
    let values: Vec<f32> = py.detach(|| entries.iter().map(&metres).collect());
    let any_measured = values.iter().any(|&z| z > 0.0);
    Ok(MetricDepth { depth: PyArray1::from_vec(py, values).reshape(shape)?.unbind(), any_measured })
}

/// Numbers of pixels.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct EqualRuns {
    /// In runs of the length asked for, or longer.
    long: usize,
    /// In shorter runs of at least half that length.
    half: usize,
    /// Equal to the one before.
    equal: usize,
    /// With a measurement.
    measured: usize,
}

/// Runs of equal depths along rows (n, m), 0 for no measurement; `long` pixels are a long run.
#[pyfunction]
fn equal_runs(py: Python<'_>, lines: PyReadonlyArray2<'_, f32>, long: usize) -> PyResult<EqualRuns> {
    let (lines, mut strided) = (lines.as_array(), Vec::new());
    let counted = py.detach(|| {
        let mut counted = runs::EqualRuns::default();
        for line in lines.rows() {
            if let Some(line) = line.as_slice() {
                counted.add(line, long);
            } else {
                strided.clear();
                strided.extend(line.iter());
                counted.add(&strided, long);
            }
        }
        counted
    });
    let runs::EqualRuns { long, half, equal, measured } = counted;
    Ok(EqualRuns { long, half, equal, measured })
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<MetricDepth>()?;
    m.add_class::<EqualRuns>()?;
    m.add_function(wrap_pyfunction!(equal_runs, m)?)?;
    m.add_function(wrap_pyfunction!(depth_metres, m)?)
}
