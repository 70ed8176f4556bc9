//! Synthetic scenes and their measures.

mod fields;
mod silo;
mod world;

use crate::arrays::{in_c_order, points, rows};
use crate::convert::{self, value_error};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use siloscope_scene::Exact;

/// What a camera would see without a sensor's errors, pixel by pixel.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct ExactPixels {
    /// Depth (H*W,), m; 0 where nothing is.
    depth: Py<PyArray1<f64>>,
    /// Label (H*W,).
    labels: Py<PyArray1<u8>>,
    /// Unit normals (H*W, 3).
    normals: Py<PyArray2<f64>>,
}

/// Renders a `siloscope.simulation.Scene`.
#[pyfunction]
fn render_scene(py: Python<'_>, scene: &Bound<'_, PyAny>, threads: usize) -> PyResult<ExactPixels> {
    let world = world::world(scene)?;
    let camera = convert::camera(&scene.getattr("camera")?)?;
    let pose = silo::pose(&scene.getattr("pose")?)?;
    let exact = py.detach(|| siloscope_scene::render(world.as_ref(), &camera, &pose, threads));
    let Exact { depth, labels, normals } = exact.map_err(value_error)?;
    Ok(ExactPixels {
        depth: depth.into_pyarray(py).unbind(),
        labels: labels.into_pyarray(py).unbind(),
        normals: rows(py, &normals)?.unbind(),
    })
}

/// `ExactPixels`, or `siloscope.simulation.scene.FlatPixels`.
#[derive(FromPyObject)]
struct FlatPixels<'py> {
    depth: PyReadonlyArray1<'py, f64>,
    labels: PyReadonlyArray1<'py, u8>,
    normals: PyReadonlyArray2<'py, f64>,
}

impl FlatPixels<'_> {
    fn exact(&self) -> PyResult<Exact> {
        if self.normals.shape() != [self.depth.len(), 3] {
            return Err(value_error("normals must have the shape (number of depths, 3)"));
        }
        let (depth, labels) = (in_c_order(&self.depth)?.into_owned(), in_c_order(&self.labels)?.into_owned());
        Ok(Exact { depth, labels, normals: points(&self.normals)? })
    }
}

/// What a sensor measures of them.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct MeasuredPixels {
    /// Depth (H*W,), m; 0 where there is none.
    depth: Py<PyArray1<f64>>,
    /// Which pixels (H*W,) are false returns.
    false_returns: Py<PyArray1<bool>>,
}

/// Exact pixels as a `siloscope.simulation.SensorModel` measures them.
#[pyfunction]
fn measure_depth(
    py: Python<'_>,
    sensor: &Bound<'_, PyAny>,
    camera: &Bound<'_, PyAny>,
    pixels: FlatPixels<'_>,
    seed: u64,
    threads: usize,
) -> PyResult<MeasuredPixels> {
    let (sensor, camera, exact) = (silo::sensor(sensor)?, convert::camera(camera)?, pixels.exact()?);
    let measured = py.detach(|| sensor.measure(&exact, &camera, seed, threads)).map_err(value_error)?;
    let false_returns = measured.false_returns.into_pyarray(py).unbind();
    Ok(MeasuredPixels { depth: measured.depth.into_pyarray(py).unbind(), false_returns })
}

/// A sensor's laws at given true depths.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct SensorLaws {
    /// Bias (N,), m.
    bias: Py<PyArray1<f64>>,
    /// Standard deviation (N,) of the noise, m.
    std: Py<PyArray1<f64>>,
}

/// The laws of a sensor model at true depths (N,).
#[pyfunction]
fn sensor_laws(py: Python<'_>, sensor: &Bound<'_, PyAny>, depth: PyReadonlyArray1<'_, f64>) -> PyResult<SensorLaws> {
    let (sensor, depth) = (silo::sensor(sensor)?, in_c_order(&depth)?);
    sensor.validate().map_err(value_error)?;
    let (bias, std): (Vec<f64>, Vec<f64>) = depth.iter().map(|&d| (sensor.bias_at(d), sensor.sigma_at(d))).unzip();
    Ok(SensorLaws { bias: bias.into_pyarray(py).unbind(), std: std.into_pyarray(py).unbind() })
}

/// A feed's truth. Metres over the cone's vertex.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct FeedContent {
    /// Volume, m³.
    volume: f64,
    /// Area of its surface seen from above, m².
    area: f64,
    /// Mean height of the surface by that area.
    mean_height: f64,
    /// Highest point.
    max_height: f64,
    /// Lowest point of the surface.
    min_height: f64,
}

/// What a feed in a silo holds; None without feed.
#[pyfunction]
fn feed_content(py: Python<'_>, silo: &Bound<'_, PyAny>, feed: &Bound<'_, PyAny>) -> PyResult<Option<FeedContent>> {
    let Some(feed) = silo::feed(feed, &silo::silo(silo)?)? else { return Ok(None) };
    let siloscope_scene::volume::Content { volume, area, mean_height, max_height, min_height } =
        py.detach(|| siloscope_scene::volume::content(&feed));
    Ok(Some(FeedContent { volume, area, mean_height, max_height, min_height }))
}

/// Heights of the feed surface over the vertex at places (N, 2); NaN where the cone lies higher or outside the silo.
#[pyfunction]
fn feed_heights<'py>(
    py: Python<'py>,
    silo: &Bound<'py, PyAny>,
    feed: &Bound<'py, PyAny>,
    places: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let feed = silo::feed(feed, &silo::silo(silo)?)?;
    if places.shape()[1] != 2 {
        return Err(value_error("places must have the shape (number of places, 2)"));
    }
    let places = in_c_order(&places)?;
    let height = |&[x, y]: &[f64; 2]| feed.as_ref().map_or(f64::NAN, |feed| feed.height_above_floor(x, y));
    Ok(PyArray1::from_iter(py, places.as_chunks::<2>().0.iter().map(height)))
}

/// Volume of cylinder and bottom down to the vertex, m³.
#[pyfunction]
fn silo_capacity(silo: &Bound<'_, PyAny>) -> PyResult<f64> {
    silo::silo(silo).map(|silo| silo.capacity())
}

/// Raises `ValueError` naming the field where a silo or its feed can't be.
#[pyfunction]
fn check_silo(silo: &Bound<'_, PyAny>) -> PyResult<()> {
    silo::silo(silo).map(|_| ())
}

/// Raises `ValueError` naming the field where a sensor model can't be used.
#[pyfunction]
fn check_sensor(sensor: &Bound<'_, PyAny>) -> PyResult<()> {
    silo::sensor(sensor)?.validate().map_err(value_error)
}

/// Distance (N,) from each query (N, 3) to the nearest reference point (M, 3).
#[pyfunction]
#[pyo3(signature = (queries, reference, threads=1))]
fn nearest_distances<'py>(
    py: Python<'py>,
    queries: PyReadonlyArray2<'py, f64>,
    reference: PyReadonlyArray2<'py, f64>,
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (queries, reference) = (points(&queries)?, points(&reference)?);
    let distances = py.detach(|| siloscope::nearest_distances(&queries, &reference, threads));
    Ok(PyArray1::from_vec(py, distances.map_err(value_error)?))
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<ExactPixels>()?;
    m.add_class::<MeasuredPixels>()?;
    m.add_class::<SensorLaws>()?;
    m.add_class::<FeedContent>()?;
    m.add_function(wrap_pyfunction!(render_scene, m)?)?;
    m.add_function(wrap_pyfunction!(measure_depth, m)?)?;
    m.add_function(wrap_pyfunction!(sensor_laws, m)?)?;
    m.add_function(wrap_pyfunction!(feed_content, m)?)?;
    m.add_function(wrap_pyfunction!(feed_heights, m)?)?;
    m.add_function(wrap_pyfunction!(silo_capacity, m)?)?;
    m.add_function(wrap_pyfunction!(nearest_distances, m)?)?;
    m.add_function(wrap_pyfunction!(check_silo, m)?)?;
    m.add_function(wrap_pyfunction!(check_sensor, m)?)
}
