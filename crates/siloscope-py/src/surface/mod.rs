//! The surface fit.

mod fit;
mod tiles;
mod warm_start;

use crate::arrays;
use crate::convert::value_error;
use crate::inputs::{DepthFrame, Priors};
use crate::outcome::Refusal;
use fit::{Coverage, SurfaceFit, WallDiagnostics};
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope::base::workers::Workers;
use siloscope::geometry::parameters::PARAMETERS;
use siloscope::geometry::sensor::DepthBias;
use siloscope::geometry::surface::SiloSurface;
use siloscope::surface_fit::cloud::fit_cloud;
use siloscope::surface_fit::{fit_image, orthogonal};
use warm_start::WarmStart;

/// A fit, or why there is none.
#[derive(IntoPyObject)]
enum Outcome {
    Fitted(SurfaceFit),
    Refused(Refusal),
}

impl Outcome {
    fn of(found: siloscope::surface_fit::Outcome, coverage: bool) -> Self {
        match found {
            Ok(fit) => Self::Fitted(SurfaceFit::new(fit, coverage)),
            Err(refusal) => Self::Refused(refusal.into()),
        }
    }
}

/// Fits the wall to a depth image, float32 metres.
///
/// A wall found before, `start`, is tried first; with `coverage` it is worked out how much of the frame each label covers.
#[pyfunction]
#[pyo3(signature = (frame, priors, start=None, coverage=true))]
fn fit_depth(
    py: Python<'_>,
    frame: DepthFrame<'_>,
    priors: Priors,
    start: Option<&Bound<'_, WarmStart>>,
    coverage: bool,
) -> PyResult<Outcome> {
    let buffers = frame.metres()?;
    let (image, known) = (buffers.image()?, priors.knowledge());
    let start = start.map(|start| start.get().0);
    Ok(py.detach(|| Outcome::of(fit_image(&image, &known, start.as_ref()), coverage)))
}

/// Fits the wall to points (N, 3) in metres, thinned by a voxel grid of `grid` metres; rows that aren't finite are left
/// out.
#[pyfunction]
#[pyo3(signature = (points, priors, grid, threads=1))]
fn fit_points(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    priors: Priors,
    grid: f64,
    threads: usize,
) -> PyResult<Outcome> {
    let points: Vec<Vec3> = arrays::points(&points)?.into_iter().map(Vec3::from).collect();
    let known = priors.knowledge();
    let found = py.detach(|| fit_cloud(&points, grid, &Workers::new(threads), &known)).map_err(value_error)?;
    Ok(Outcome::of(found, false))
}

/// Wall (12,) whose squared distances from points (N, 3), m, have the least sum, from the wall `start` (12,) on.
#[pyfunction]
fn orthogonal_fit<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    start: [f64; PARAMETERS],
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points: Vec<Vec3> = arrays::points(&points)?.into_iter().map(Vec3::from).collect();
    let start = SiloSurface::of_parameters(&start.into());
    let found = py.detach(|| orthogonal::orthogonal_fit(&points, start));
    let found = found.ok_or_else(|| value_error("the points do not fix the wall"))?;
    Ok(PyArray1::from_slice(py, found.parameters(&DepthBias::default()).as_slice()))
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<SurfaceFit>()?;
    m.add_class::<WallDiagnostics>()?;
    m.add_class::<Coverage>()?;
    m.add_class::<WarmStart>()?;
    tiles::register(m)?;
    m.add_function(wrap_pyfunction!(orthogonal_fit, m)?)?;
    m.add_function(wrap_pyfunction!(fit_depth, m)?)?;
    m.add_function(wrap_pyfunction!(fit_points, m)?)
}
