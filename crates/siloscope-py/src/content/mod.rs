//! Content: surface map and volume.

mod result;
mod surface;

use crate::arrays;
use crate::convert::value_error;
use crate::inputs::{DepthFrame, depth_bias, noise_law};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use result::{
    BareFloor, CellCounts, Component, ContentMeasure, ReturnCounts, Shape, Sight, SurfaceVolume, VolumeStd, WallShift,
};
use siloscope::content::cloud::Relief;
use siloscope::content::jacobian::Covariance;
use siloscope::content::silo_points::Source;
use siloscope::content::{Setup, bare_reach, measure};
use siloscope::geometry::floor_map::FloorMap;
use siloscope::geometry::vessel::Vessel;
use siloscope::{SiloPose, Vec3};
use surface::{ContentSurface, MapGrid};

/// `siloscope.content.setup.CoreVessel`.
#[derive(FromPyObject)]
struct Silo {
    radius: f64,
    cylinder_bottom: f64,
    apex: f64,
    top: f64,
    outlet_radius: f64,
    outlet_length: f64,
    oval_cos: f64,
    oval_sin: f64,
}

impl From<Silo> for Vessel {
    fn from(silo: Silo) -> Self {
        let Silo { radius, cylinder_bottom, apex, top, outlet_radius, outlet_length, oval_cos, oval_sin } = silo;
        Self { radius, cylinder_bottom, apex, top, outlet_radius, outlet_length, ovality: [oval_cos, oval_sin] }
    }
}

/// `siloscope.content.setup.CoreFloor`.
#[derive(FromPyObject)]
struct Floor<'py> {
    reach: f64,
    z: PyReadonlyArray2<'py, f64>,
    std: PyReadonlyArray2<'py, f64>,
    of_camera: bool,
}

impl Floor<'_> {
    fn of_core(&self) -> PyResult<FloorMap> {
        let side = self.z.shape().first().copied().unwrap_or(0);
        let flat = |values| arrays::in_c_order(values).map(|values| values.to_vec());
        FloorMap::new(self.reach, side, flat(&self.z)?, flat(&self.std)?, self.of_camera).map_err(value_error)
    }
}

/// Volume of a silo below level planes at heights z.
#[pyfunction]
fn vessel_volume_below(silo: Silo, z: Vec<f64>) -> PyResult<Vec<f64>> {
    let vessel = Vessel::from(silo);
    vessel.validate().map_err(value_error)?;
    Ok(z.into_iter().map(|z| vessel.volume_below(z)).collect())
}

/// `siloscope.types.pose.SiloPose`.
#[derive(FromPyObject)]
struct Pose {
    r_x: f64,
    r_y: f64,
    t_x: f64,
    t_y: f64,
}

/// `siloscope.content.knowledge.Knowledge`.
#[derive(FromPyObject)]
struct Knowledge<'py> {
    pose: Pose,
    covariance: PyReadonlyArray2<'py, f64>,
    bias: [f64; 3],
    noise: [f64; 6],
    noise_known: bool,
    range: [f64; 2],
}

/// `siloscope.content.setup.ContentSetup`.
#[derive(FromPyObject)]
struct ContentSetup<'py> {
    known: Knowledge<'py>,
    silo: Silo,
    floor: Option<Floor<'py>>,
    wall_std: f64,
}

impl ContentSetup<'_> {
    fn of_core(self) -> PyResult<Setup> {
        let Knowledge { pose: Pose { r_x, r_y, t_x, t_y }, covariance, bias, noise, noise_known, range } = self.known;
        Ok(Setup {
            pose: SiloPose { r_x, r_y, t_x, t_y },
            vessel: self.silo.into(),
            floor: self.floor.as_ref().map(Floor::of_core).transpose()?,
            covariance: matrix(&covariance)?,
            wall_std: self.wall_std,
            bias: depth_bias(bias),
            noise: noise_law(noise),
            noise_known,
            range,
        })
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

/// Measures the content of a depth image in float32 metres, or of points.
#[pyfunction]
fn content_measure(py: Python<'_>, data: Data<'_>, setup: ContentSetup<'_>) -> PyResult<ContentMeasure> {
    let setup = setup.of_core()?;
    ContentMeasure::new(py, data.with_source(py, |source| measure(source, &setup))?)
}

/// The farthest bare wall that a frame shows; None where it shows none.
#[pyfunction]
fn content_bare_reach(py: Python<'_>, data: Data<'_>, setup: ContentSetup<'_>) -> PyResult<Option<BareReach>> {
    let setup = setup.of_core()?;
    let reach = data.with_source(py, |source| bare_reach(source, &setup))?;
    Ok(reach.map(|[farthest, cell]| BareReach { farthest, cell }))
}

/// The farthest bare wall, and how finely it is known.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct BareReach {
    /// Its distance from the axis, m.
    farthest: f64,
    /// Side of the cells that tell it, m.
    cell: f64,
}

fn matrix(covariance: &PyReadonlyArray2<'_, f64>) -> PyResult<Covariance> {
    if covariance.shape() != [10, 10] {
        return Err(value_error(format!("the covariance has shape {:?}, expected [10, 10]", covariance.shape())));
    }
    Ok(Covariance::from_iterator(arrays::in_c_order(covariance)?.iter().copied()))
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
    m.add_function(wrap_pyfunction!(content_relief, m)?)?;
    m.add_class::<ContentMeasure>()?;
    m.add_class::<SurfaceVolume>()?;
    m.add_class::<VolumeStd>()?;
    m.add_class::<CellCounts>()?;
    m.add_class::<Component>()?;
    m.add_class::<BareFloor>()?;
    m.add_class::<ReturnCounts>()?;
    m.add_class::<Sight>()?;
    m.add_class::<WallShift>()?;
    m.add_class::<Shape>()?;
    m.add_class::<BareReach>()?;
    m.add_class::<MapGrid>()?;
    m.add_class::<ContentSurface>()
}
