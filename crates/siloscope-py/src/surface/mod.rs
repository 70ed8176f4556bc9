//! The surface fit.

mod factor;
mod fit;
mod warm_start;

use crate::arrays::{self, in_c_order};
use crate::convert::value_error;
use crate::inputs::{DepthFrame, Priors};
use crate::outcome::Refusal;
use factor::{FrameFactor, MapIncrement};
use fit::{Coverage, SurfaceFit, WallDiagnostics};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope::base::workers::Workers;
use siloscope::fusion::relinearize::{Ray, seen_from};
use siloscope::geometry::parameters::PARAMETERS;
use siloscope::surface_fit::{fit_cloud, fit_image};
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

/// What the equations of N frames, made at `bases` (N, 12) with `rays` (N, K, 3) and `free` parameters (N, 12), predict
/// for the readings of the walls at `places` (N, 12).
#[pyfunction]
fn map_increment(
    py: Python<'_>,
    bases: PyReadonlyArray2<'_, f64>,
    rays: PyReadonlyArray3<'_, f64>,
    free: PyReadonlyArray2<'_, bool>,
    places: PyReadonlyArray2<'_, f64>,
) -> PyResult<MapIncrement> {
    let count = bases.shape()[0];
    let whole = bases.shape()[1] == PARAMETERS && rays.shape()[2] == 3;
    if !whole || rays.shape()[0] != count || free.shape() != bases.shape() || places.shape() != bases.shape() {
        let shapes = (bases.shape(), rays.shape(), free.shape(), places.shape());
        return Err(value_error(format!("bases, rays, free and places have shapes {shapes:?}")));
    }
    let per_frame = rays.shape()[1];
    let (bases, rays) = (in_c_order(&bases)?, in_c_order(&rays)?);
    let (free, places) = (in_c_order(&free)?, in_c_order(&places)?);
    let seen: Vec<_> = py.detach(|| {
        let [bases, places] = [&bases, &places].map(|rows| rows.as_chunks::<PARAMETERS>().0);
        let free = free.as_chunks::<PARAMETERS>().0;
        let rays: &[Ray] = rays.as_chunks::<3>().0;
        let carried = |n: usize| {
            let rays = rays.get(n * per_frame..(n + 1) * per_frame).unwrap_or_default();
            seen_from(&bases[n].into(), rays, free[n], &places[n].into())
        };
        (0..count).map(carried).collect()
    });
    let steps: Vec<f64> = seen.iter().flat_map(|(step, _)| step.iter().copied()).collect();
    let turns: Vec<f64> =
        seen.iter().flat_map(|(_, turn)| turn.transpose().iter().copied().collect::<Vec<_>>()).collect();
    let step = PyArray1::from_vec(py, steps).reshape([count, PARAMETERS])?.unbind();
    let jacobian = PyArray1::from_vec(py, turns).reshape([count, PARAMETERS, PARAMETERS])?.unbind();
    Ok(MapIncrement { step, jacobian })
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<SurfaceFit>()?;
    m.add_class::<WallDiagnostics>()?;
    m.add_class::<Coverage>()?;
    m.add_class::<FrameFactor>()?;
    m.add_class::<MapIncrement>()?;
    m.add_class::<WarmStart>()?;
    m.add_function(wrap_pyfunction!(fit_depth, m)?)?;
    m.add_function(wrap_pyfunction!(fit_points, m)?)?;
    m.add_function(wrap_pyfunction!(map_increment, m)?)
}
