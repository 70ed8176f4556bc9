//! Content: surface map and volume.

use crate::arrays;
use crate::convert::value_error;
use crate::inputs::{DepthFrame, depth_bias, noise_law};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use siloscope::content::cells::Cell;
use siloscope::content::classify::Thing;
use siloscope::content::cloud::Relief;
use siloscope::content::fit::Surface;
use siloscope::content::jacobian::Covariance;
use siloscope::content::shape::{Form, Shape};
use siloscope::content::silo_points::Source;
use siloscope::content::volume::Kind;
use siloscope::content::{Content, Setup, bare_reach, measure, shape_of};
use siloscope::geometry::vessel::Vessel;
use siloscope::{SiloPose, Vec3};

/// A silo as Python gives it: radius, cylinder_bottom, apex, top, outlet radius and length, ovality c and s.
fn vessel([radius, cylinder_bottom, apex, top, outlet_radius, outlet_length, c, s]: [f64; 8]) -> Vessel {
    Vessel { radius, cylinder_bottom, apex, top, outlet_radius, outlet_length, ovality: [c, s] }
}

/// Volume of a silo (see `vessel`) below level planes at heights z.
#[pyfunction]
fn vessel_volume_below(silo: [f64; 8], z: Vec<f64>) -> PyResult<Vec<f64>> {
    let vessel = vessel(silo);
    vessel.validate().map_err(value_error)?;
    Ok(z.into_iter().map(|z| vessel.volume_below(z)).collect())
}

/// What is known before the frame, as the core takes it.
#[pyclass(frozen, module = "siloscope._core")]
struct ContentSetup(Setup);

#[pymethods]
impl ContentSetup {
    #[new]
    #[pyo3(signature = (pose, silo, covariance, wall_std, bias, noise, noise_known, range))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        pose: [f64; 4],
        silo: [f64; 8],
        covariance: PyReadonlyArray2<'_, f64>,
        wall_std: f64,
        bias: [f64; 3],
        noise: [f64; 6],
        noise_known: bool,
        range: [f64; 2],
    ) -> PyResult<Self> {
        Ok(Self(Setup {
            pose: SiloPose { r_x: pose[0], r_y: pose[1], t_x: pose[2], t_y: pose[3] },
            vessel: vessel(silo),
            covariance: matrix(&covariance)?,
            wall_std,
            bias: depth_bias(bias),
            noise: noise_law(noise),
            noise_known,
            range,
        }))
    }
}

/// A depth image, or points (N, 3) in metres.
#[derive(FromPyObject)]
enum Data<'py> {
    Points(PyReadonlyArray2<'py, f32>),
    Depth(DepthFrame<'py>),
}

impl Data<'_> {
    /// Runs something on the core's view of it, without the interpreter's lock.
    fn with_source<T: Send>(
        &self,
        py: Python<'_>,
        run: impl Fn(Source<'_>) -> siloscope::Result<T> + Send + Sync,
    ) -> PyResult<T> {
        match self {
            Self::Points(points) => {
                let rows = arrays::rows_of_three(points)?;
                py.detach(|| run(Source::Points(rows.as_chunks::<3>().0))).map_err(value_error)
            }
            Self::Depth(frame) => {
                let buffers = frame.metres()?;
                let image = buffers.image()?;
                py.detach(|| run(Source::Depth(image))).map_err(value_error)
            }
        }
    }
}

/// Measures the content of a depth image in float32 metres, or of points; the surface is None where there is none.
#[pyfunction]
fn content_measure<'py>(
    py: Python<'py>,
    data: Data<'py>,
    setup: &ContentSetup,
) -> PyResult<(Bound<'py, PyDict>, Option<ContentSurface>)> {
    let content = data.with_source(py, |source| measure(source, &setup.0))?;
    Ok((report(py, &content)?, ContentSurface::of_content(content)))
}

/// Distance from the axis of the farthest bare wall that a frame shows, and the size of the cells that tell; or None.
#[pyfunction]
fn content_bare_reach(py: Python<'_>, data: Data<'_>, setup: &ContentSetup) -> PyResult<Option<[f64; 2]>> {
    data.with_source(py, |source| bare_reach(source, &setup.0))
}

fn matrix(covariance: &PyReadonlyArray2<'_, f64>) -> PyResult<Covariance> {
    if covariance.shape() != [10, 10] {
        return Err(value_error(format!("the covariance has shape {:?}, expected [10, 10]", covariance.shape())));
    }
    Ok(Covariance::from_iterator(covariance.as_array().iter().copied()))
}

fn report<'py>(py: Python<'py>, content: &Content) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    if let Some(v) = &content.volume {
        let volume = PyDict::new(py);
        volume.set_item("volume", v.volume)?;
        volume.set_item("area", v.area)?;
        volume.set_item("seen", v.seen)?;
        volume.set_item("moment", v.moment)?;
        volume.set_item("extremes", v.extremes)?;
        volume.set_item("at_wall", v.at_wall)?;
        volume.set_item("wall_share", v.wall_share)?;
        volume.set_item("reach", v.reach)?;
        out.set_item("volume", volume)?;
    } else {
        out.set_item("volume", py.None())?;
    }
    let doubts = PyDict::new(py);
    let d = &content.doubts;
    for (name, std) in [
        ("pose", d.pose),
        ("geometry", d.geometry),
        ("depth", d.depth),
        ("noise", d.noise),
        ("unseen", d.unseen),
        ("grid", d.grid),
        ("total", d.total),
    ] {
        doubts.set_item(name, std)?;
    }
    out.set_item("std", doubts)?;
    out.set_item("derivatives", content.derivatives.as_slice().to_vec())?;
    let count = |kind: Kind| content.kinds.iter().filter(|k| **k == kind).count();
    let kinds = [Kind::Unseen, Kind::Feed, Kind::Rim, Kind::Bare, Kind::Clutter].map(count);
    out.set_item("kinds", kinds)?;
    let cell_area = content.grid.cell().powi(2);
    let list = |things: &[Thing]| {
        things.iter().map(|t| (t.cells.len() as f64 * cell_area, t.above, t.at_wall)).collect::<Vec<_>>()
    };
    out.set_item("things", list(&content.things))?;
    out.set_item("holes", list(&content.holes))?;
    out.set_item("shape", content.shape.as_ref().map(|s| shape(py, s)).transpose()?)?;
    out.set_item("bare", content.bare)?;
    out.set_item("sunken", content.sunken)?;
    let t = &content.tally;
    out.set_item("tally", (t.returns, t.wall, t.outside, t.above, t.coherent))?;
    let s = &content.sight;
    out.set_item("sight", (s.measured, s.blind, s.near))?;
    out.set_item("shift", content.shift.map(|s| (s.change, s.std, s.rms, s.left)))?;
    Ok(out)
}

fn shape<'py>(py: Python<'py>, shape: &Shape) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let form = match shape.form {
        Form::Flat => "flat",
        Form::Tilted => "tilted",
        Form::Mound => "mound",
        Form::Funnel => "funnel",
        Form::Irregular => "irregular",
    };
    out.set_item("form", form)?;
    out.set_item("flank", shape.flank)?;
    out.set_item("steepness", shape.steepness)?;
    out.set_item("centre", shape.centre)?;
    out.set_item("tilt", shape.tilt)?;
    out.set_item("asymmetry", shape.asymmetry)?;
    out.set_item("irregularity", shape.irregularity)?;
    Ok(out)
}

/// The surface of one frame or cloud, z down from its own zero.
#[pyclass(frozen, module = "siloscope._core")]
struct ContentSurface {
    surface: Surface,
    cells: Vec<Cell>,
    kinds: Vec<Kind>,
    ceiling: f64,
    axes: [[f64; 3]; 3],
}

const STANDING: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl ContentSurface {
    fn of_content(content: Content) -> Option<Self> {
        let surface = content.surface?;
        Some(Self { surface, cells: content.cells, kinds: content.kinds, ceiling: 0.0, axes: STANDING })
    }

    fn of_relief(relief: Relief) -> Self {
        let axes = [0, 1, 2].map(|i| [0, 1, 2].map(|j| relief.axes[(i, j)]));
        Self { surface: relief.surface, cells: relief.cells, kinds: relief.kinds, ceiling: relief.ceiling, axes }
    }

    fn map<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        value: impl Fn(usize) -> T,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        let side = self.surface.grid.side;
        PyArray1::from_iter(py, (0..side * side).map(value)).reshape([side, side])
    }
}

#[pymethods]
impl ContentSurface {
    /// Centre, half side (m) and cells along a side of the square map.
    #[getter]
    fn grid(&self) -> ([f64; 2], f64, usize) {
        (self.surface.grid.centre, self.surface.grid.reach, self.surface.grid.side)
    }

    /// Height of z = 0 over the cloud's own zero; 0 for a silo.
    #[getter]
    fn ceiling(&self) -> f64 {
        self.ceiling
    }

    /// Rows: the two horizontal axes and up, in the axes of the cloud.
    #[getter]
    fn axes(&self) -> [[f64; 3]; 3] {
        self.axes
    }

    /// What each cell shows (n, n): 0 nothing, 1 content, 2 content's rim, 3 bare floor, 4 something else.
    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        self.map(py, |i| self.kinds.get(i).map_or(0, |k| *k as u8))
    }

    /// z of the surface at the cells' middles (n, n), rows along y.
    fn z<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.map(py, |i| {
            let [x, y] = self.surface.grid.middle(i);
            self.surface.height(x, y)
        })
    }

    /// Standard deviation of that z (n, n): what noise and the unseen leave.
    fn std<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let std = py.detach(|| self.surface.deviations(&self.cells));
        self.map(py, |i| std.get(i).copied().unwrap_or(f64::NAN))
    }

    /// z of the surface at places (N, 2).
    fn z_at<'py>(&self, py: Python<'py>, places: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if places.shape()[1] != 2 {
            return Err(value_error(format!("places have shape {:?}, expected (N, 2)", places.shape())));
        }
        let places = places.as_array();
        let z = places.rows().into_iter().map(|p| self.surface.height(p[0], p[1]));
        Ok(PyArray1::from_iter(py, z))
    }

    /// Shape of the seen part, or None where it is too small.
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        shape_of(&self.surface, &self.cells, self.surface.grid.reach).map(|s| shape(py, &s)).transpose()
    }
}

/// Maps a bare point cloud (N, 3) over the plane perpendicular to `up`; None where there are too few points.
#[pyfunction]
#[pyo3(signature = (points, up, cell, noise))]
fn content_relief(
    py: Python<'_>,
    points: PyReadonlyArray2<'_, f64>,
    up: [f64; 3],
    cell: Option<f64>,
    noise: f64,
) -> PyResult<Option<ContentSurface>> {
    let points = arrays::points(&points)?;
    let relief = py.detach(|| Relief::new(&points, &Vec3::from(up), cell, noise)).map_err(value_error)?;
    Ok(relief.map(ContentSurface::of_relief))
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(vessel_volume_below, m)?)?;
    m.add_function(wrap_pyfunction!(content_measure, m)?)?;
    m.add_function(wrap_pyfunction!(content_bare_reach, m)?)?;
    m.add_class::<ContentSetup>()?;
    m.add_function(wrap_pyfunction!(content_relief, m)?)?;
    m.add_class::<ContentSurface>()
}
