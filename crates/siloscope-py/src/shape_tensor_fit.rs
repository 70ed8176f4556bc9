//! The six steps' result.

use crate::outcome::{StageTime, stages};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use siloscope::shape_tensor::Located;
use siloscope::shape_tensor::diagnostics::Evidence;

/// Axis and wall of a frame by the six steps. Radians and metres.
#[pyclass(frozen, module = "siloscope._core")]
pub struct ShapeTensorFit(pub Box<Located>);

/// A length with its standard deviation, m.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct Length {
    /// The length.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

#[pymethods]
impl ShapeTensorFit {
    /// r_x, r_y, t_x, t_y.
    #[getter]
    fn pose(&self) -> [f64; 4] {
        let pose = self.0.pose;
        [pose.r_x, pose.r_y, pose.t_x, pose.t_y]
    }

    /// Covariance (4, 4) of the pose.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_slice(py, self.0.covariance.as_slice()).reshape([4, 4])
    }

    /// Radius of the cylinder; None where it is not seen.
    #[getter]
    fn radius(&self) -> Option<Length> {
        self.0.profile.radius.map(|value| Length { value, std: self.0.profile.radius_std })
    }

    /// z of the cone's vertex; None where the cone is not seen.
    #[getter]
    fn apex(&self) -> Option<Length> {
        self.0.profile.cone.map(|cone| Length { value: cone.apex, std: self.0.profile.apex_std() })
    }

    /// z where the cylinder meets the cone; None where one of them is not seen.
    #[getter]
    fn bottom(&self) -> Option<Length> {
        self.0.profile.bottom().map(|value| Length { value, std: self.0.profile.bottom_std() })
    }

    /// Standard deviation of the wall about its model, m.
    #[getter]
    fn model_error_std(&self) -> f64 {
        self.0.profile.misfit
    }

    /// Number of pixels by label: none, cylinder, cone, feed, other.
    #[getter]
    fn pixels(&self) -> [f64; 5] {
        self.0.coverage.pixels
    }

    /// Surface by label, m²: none, cylinder, cone, feed, other.
    #[getter]
    fn areas(&self) -> [f64; 5] {
        self.0.coverage.areas
    }

    /// What the answer rests on.
    #[getter]
    fn diagnostics(&self) -> StepsDiagnostics {
        self.0.evidence.into()
    }

    /// The steps with their times, in order.
    #[getter]
    fn stages(&self) -> Vec<StageTime> {
        stages(&self.0.timing)
    }
}

/// What was measured on the walls that the axis rests on.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct StepsDiagnostics {
    /// Points of the voxel grid.
    pub points: usize,
    /// Candidates of step 3.
    pub candidates: usize,
    /// Those of them that agree with the axis direction.
    pub walls: usize,
    /// Spread of E1 about the axis: 1 where walls are seen all around, 0 where they all face the same way.
    pub around: f64,
    /// Spread of E1 along the axis over that: 0 on cylinder and cone.
    pub along: f64,
    /// Sine of the angle at which the normals pass the axis, median.
    pub miss: f64,
    /// Curvature over that of the circle about the axis, median: 1 seen from inside, -1 from outside.
    pub turn: f64,
    /// The same for the other curvature: 0 on cylinder and cone, 1 on a sphere.
    pub bend: f64,
    /// Fraction of the pixels behind the wall.
    pub behind: f64,
}

impl From<Evidence> for StepsDiagnostics {
    fn from(e: Evidence) -> Self {
        let Evidence { points, candidates, walls, around, along, miss, turn, bend, behind } = e;
        Self { points, candidates, walls, around, along, miss, turn, bend, behind }
    }
}
