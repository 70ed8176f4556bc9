//! A frame's tiles against a wall that is told.

use crate::arrays::in_c_order;
use crate::convert::value_error;
use crate::inputs::{DepthFrame, Priors};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use siloscope::geometry::surface::Part;
use siloscope::surface_fit::joint::against::{TileAgainstWall, readings_of, tiles_against};
use siloscope::surface_fit::joint::parameters::{JointState, SIZE};

/// A wall in all parameters: `siloscope.types.wall.Wall`.
#[derive(FromPyObject)]
pub struct GivenWall<'py> {
    state: PyReadonlyArray1<'py, f64>,
    has_cylinder: bool,
    has_cone: bool,
    reference: f64,
}

impl GivenWall<'_> {
    fn state(&self) -> PyResult<JointState> {
        let state = in_c_order(&self.state)?;
        let x: [f64; SIZE] =
            state.as_ref().try_into().map_err(|_| value_error(format!("a wall has {SIZE} parameters")))?;
        if !x.iter().all(|v| v.is_finite()) || !(self.has_cylinder || self.has_cone) {
            return Err(value_error("a wall has finite parameters, and a cylinder or a cone"));
        }
        Ok(JointState { x, has_cylinder: self.has_cylinder, has_cone: self.has_cone, reference: self.reference })
    }
}

/// Smooth tiles of a frame whose rays meet a wall. N of them; lengths in metres.
#[pyclass(frozen, module = "siloscope._core")]
pub struct WallTiles(Vec<TileAgainstWall>);

impl WallTiles {
    fn column<'py>(&self, py: Python<'py>, of: impl Fn(&TileAgainstWall) -> f64) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.0.iter().map(of))
    }

    fn table<'py, const K: usize>(
        &self,
        py: Python<'py>,
        of: impl Fn(&TileAgainstWall) -> [f64; K],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_iter(py, self.0.iter().flat_map(of)).reshape([self.0.len(), K])
    }
}

#[pymethods]
impl WallTiles {
    /// Numbers (N,) among all of the frame's tiles, in the order of `SurfaceFit.points`.
    #[getter]
    fn number<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        PyArray1::from_iter(py, self.0.iter().map(|tile| tile.number as u64))
    }

    /// Columns and rows (N, 2) in the grid of tiles.
    #[getter]
    fn place<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, |tile| [f64::from(tile.place.0), f64::from(tile.place.1)])
    }

    /// Rays (N, 2), (x/z, y/z) by the given intrinsics.
    #[getter]
    fn ray<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, |tile| tile.sight.ray)
    }

    /// Reading less prediction (N,) along the ray.
    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |tile| tile.sight.residual)
    }

    /// Variance (N,) of the tile's mean by the sensor's noise, m².
    #[getter]
    fn variance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |tile| tile.variance)
    }

    /// Depth of the wall (N,).
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |tile| tile.sight.depth)
    }

    /// Height z (N,) of the wall there, in the silo frame.
    #[getter]
    fn height<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |tile| tile.sight.at.z)
    }

    /// Azimuth (N,) about the part's centre, rad.
    #[getter]
    fn azimuth<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |tile| tile.sight.at.radial[1].atan2(tile.sight.at.radial[0]))
    }

    /// Distance from the wall (N,) across it per metre of residual.
    #[getter]
    fn across<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.column(py, |tile| tile.sight.rate / tile.sight.at.gradient_norm())
    }

    /// Whether (N,) the wall there is the cone.
    #[getter]
    fn on_cone<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_iter(py, self.0.iter().map(|tile| tile.sight.at.part == Part::Cone))
    }

    /// Derivative (N, 71) of the residual by all parameters, in the order of `siloscope.types.frame_factor.GROUPS`.
    #[getter]
    fn jacobian<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, |tile| tile.row)
    }
}

/// The tiles of a depth image, float32 metres, against a wall; of the priors only the sensor's profile counts.
#[pyfunction]
#[pyo3(signature = (frame, priors, wall))]
fn wall_tiles(py: Python<'_>, frame: DepthFrame<'_>, priors: Priors, wall: GivenWall<'_>) -> PyResult<WallTiles> {
    let buffers = frame.metres()?;
    let (image, known, state) = (buffers.image()?, priors.knowledge(), wall.state()?);
    Ok(py.detach(|| WallTiles(tiles_against(&image, &known, &state))))
}

/// What the pixels (H, W) of a frame would read of a wall, metres; NaN where no ray meets it.
#[pyfunction]
#[pyo3(signature = (frame, wall))]
fn wall_readings<'py>(
    py: Python<'py>,
    frame: DepthFrame<'_>,
    wall: GivenWall<'_>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let buffers = frame.metres()?;
    let (image, state) = (buffers.image()?, wall.state()?);
    let readings = py.detach(|| readings_of(&image, &state));
    PyArray1::from_vec(py, readings).reshape([image.height, image.width])
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<WallTiles>()?;
    m.add_function(wrap_pyfunction!(wall_tiles, m)?)?;
    m.add_function(wrap_pyfunction!(wall_readings, m)?)
}
