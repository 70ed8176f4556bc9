//! What one frame says about all parameters, and that at another linearisation point.

use crate::arrays::{matrix, rows};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use siloscope::fusion::frame_factor;

/// A frame's Gaussian factor, without priors. Vectors (12,), matrices (12, 12) in the order of
/// `siloscope.parameters.PARAMETERS`.
#[pyclass(frozen, module = "siloscope._core")]
pub struct FrameFactor(pub frame_factor::FrameFactor);

#[pymethods]
impl FrameFactor {
    /// From the frame's own answer to the one with the silo's ovality estimated.
    #[getter]
    fn step<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.step.as_slice())
    }

    /// Information of this frame alone.
    #[getter]
    fn information<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.0.information)
    }

    /// Gradient of the negative log-likelihood after `step`.
    #[getter]
    fn gradient<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.gradient.as_slice())
    }

    /// Covariance of `gradient` as the residuals have it.
    #[getter]
    fn scatter<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.0.scatter)
    }

    /// The part of `scatter` that the sensor's noise makes.
    #[getter]
    fn noise<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.0.noise)
    }

    /// Information of the priors that were used, by parameter.
    #[getter]
    fn prior_information<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.prior.as_slice())
    }

    /// Where the equations were made; NaN for what is not there.
    #[getter]
    fn linearization_point<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.base.as_slice())
    }

    /// Some of the wall's rays (K, 3): (x, y) of (x, y, 1) and their information, 1/m².
    #[getter]
    fn rays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.0.rays)
    }
}

/// How N frames' equations are carried from their linearisation points to other ones.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct MapIncrement {
    /// Steps (N, 12) that predict the readings of the walls at the other points.
    pub step: Py<PyArray2<f64>>,
    /// Their derivatives (N, 12, 12).
    pub jacobian: Py<PyArray3<f64>>,
}
