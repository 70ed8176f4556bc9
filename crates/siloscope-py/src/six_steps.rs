//! Bindings of the six steps in one call: from a frame to the axis.

use crate::convert::value_error;
use crate::inputs::{DepthArray, DepthFrame, FrameBuffers, Priors};
use crate::outcome::Refusal;
use crate::shape_tensor_fit::{Length, ShapeTensorFit, StepsDiagnostics};
use crate::steps::{Doubles, vectors, view};
use pyo3::prelude::*;
use siloscope::geometry::depth_image::Depth;
use siloscope::shape_tensor;
use siloscope::shape_tensor::instrument::SensorErrors;

/// `siloscope.estimation.shape_tensor.Settings`.
#[derive(FromPyObject)]
struct Settings {
    grid: f64,
    neighbours: usize,
    view: String,
    share: f64,
    agreement: f64,
    partners: usize,
    threads: usize,
}

impl Settings {
    fn of_core(self, errors: SensorErrors) -> PyResult<shape_tensor::Settings> {
        let Self { grid, neighbours, view, share, agreement, partners, threads } = self;
        let view = self::view(&view)?;
        Ok(shape_tensor::Settings { grid, neighbours, view, share, agreement, partners, threads, errors })
    }
}

/// Runs the six steps on a depth image of a sensor whose errors are known by its priors.
#[pyfunction]
fn shape_tensor_depth(
    py: Python<'_>,
    frame: DepthFrame<'_>,
    settings: Settings,
    priors: Option<Priors>,
) -> PyResult<Outcome> {
    let settings = settings.of_core(priors.map_or_else(SensorErrors::default, |priors| priors.sensor_errors()))?;
    match &frame.depth {
        DepthArray::Single(depth) => located(py, &frame.buffers(depth)?, &settings),
        DepthArray::Double(depth) => located(py, &frame.buffers(depth)?, &settings),
        DepthArray::Raw(depth) => located(py, &frame.buffers(depth)?, &settings),
    }
}

fn located<T: Depth>(
    py: Python<'_>,
    buffers: &FrameBuffers<T>,
    settings: &shape_tensor::Settings,
) -> PyResult<Outcome> {
    let image = buffers.image()?;
    py.detach(|| shape_tensor::locate_in_image(&image, settings)).map(Outcome::from).map_err(value_error)
}

/// Runs the six steps on points (N, 3), metres, seen from the origin; rows that aren't finite are left out.
#[pyfunction]
fn shape_tensor_points(py: Python<'_>, points: Doubles, settings: Settings) -> PyResult<Outcome> {
    let (points, settings) = (vectors(&points)?, settings.of_core(SensorErrors::default())?);
    py.detach(|| shape_tensor::locate_in_points(&points, &settings)).map(Outcome::from).map_err(value_error)
}

/// The axis, or why there is none.
#[derive(IntoPyObject)]
enum Outcome {
    Found(ShapeTensorFit),
    Refused(Refusal),
}

impl From<shape_tensor::Outcome> for Outcome {
    fn from(found: shape_tensor::Outcome) -> Self {
        match found {
            Ok(found) => Self::Found(ShapeTensorFit(Box::new(found))),
            Err(refusal) => Self::Refused(refusal.into()),
        }
    }
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<ShapeTensorFit>()?;
    m.add_class::<StepsDiagnostics>()?;
    m.add_class::<Length>()?;
    m.add_function(wrap_pyfunction!(shape_tensor_depth, m)?)?;
    m.add_function(wrap_pyfunction!(shape_tensor_points, m)?)
}
