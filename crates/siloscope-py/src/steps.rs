//! The paper's six steps, one function each.

use crate::convert::{camera, value_error};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use siloscope::base::workers::Workers;
use siloscope::geometry::depth_image::{self, Depth, DepthImage};
use siloscope::geometry::normals;
use siloscope::shape_tensor::axis::{self, Wall};
use siloscope::shape_tensor::candidates::{self, Candidate, View};
use siloscope::shape_tensor::tensors::ShapeTensor;
use siloscope::shape_tensor::{self, Outcome};
use siloscope::stats::neighbours::Neighbours;
use siloscope::stats::{neighbours, voxel_grid as grid};
use siloscope::{Camera, Vec3};

type Doubles<'py> = PyReadonlyArray2<'py, f64>;
type Vectors<'py> = Bound<'py, PyArray2<f64>>;
type Numbers<'py> = Bound<'py, PyArray1<f64>>;
type Indices<'py> = Bound<'py, PyArray1<u32>>;

/// A stored depth image: metres as float32 or float64, raw units as uint16.
#[derive(FromPyObject)]
enum DepthArray<'py> {
    Single(PyReadonlyArray2<'py, f32>),
    Double(PyReadonlyArray2<'py, f64>),
    Raw(PyReadonlyArray2<'py, u16>),
}

/// A depth image as a Python caller describes it.
struct Described<'a> {
    camera: Camera,
    rays: Option<&'a [[f64; 2]]>,
    unit: f64,
    mask: Option<&'a [bool]>,
}

impl Described<'_> {
    fn image<'a, T: Element + Depth>(&'a self, depth: &'a PyReadonlyArray2<T>) -> PyResult<DepthImage<'a, T>> {
        let image = DepthImage::new(entries(depth)?, &self.camera, self.rays);
        let image = image.and_then(|image| image.with_unit(self.unit)).map_err(value_error)?;
        self.mask.map_or(Ok(image), |mask| image.with_mask(mask)).map_err(value_error)
    }
}

/// Entries of an array in C order, which the package sees to.
fn entries<'a, T: Element>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<&'a [T]> {
    match array.is_c_contiguous() {
        true => Ok(array.as_slice()?),
        false => Err(value_error("arrays must be in C order")),
    }
}

fn vectors(array: &Doubles) -> PyResult<Vec<Vec3>> {
    match array.shape() {
        [_, 3] => Ok(entries(array)?.chunks_exact(3).map(Vec3::from_column_slice).collect()),
        shape => Err(value_error(format!("expected vectors of shape (N, 3), got {shape:?}"))),
    }
}

fn to_array<'py>(py: Python<'py>, vectors: &[Vec3]) -> PyResult<Vectors<'py>> {
    let flat: Vec<f64> = vectors.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    flat.into_pyarray(py).reshape([vectors.len(), 3])
}

fn same_length(what: &str, got: usize, expected: usize) -> PyResult<()> {
    match got == expected {
        true => Ok(()),
        false => Err(value_error(format!("{what} has {got} rows, expected {expected}"))),
    }
}

fn near(neighbours: &PyReadonlyArray2<u32>, n: usize) -> PyResult<Neighbours> {
    let [rows, k] = neighbours.shape() else { return Err(value_error("neighbours must be two-dimensional")) };
    same_length("neighbours", *rows, n)?;
    Neighbours::from_indices(*k, entries(neighbours)?.to_vec(), n).map_err(value_error)
}

/// A view by name; None for "auto".
fn view(name: &str) -> PyResult<Option<View>> {
    match name {
        "auto" => Ok(None),
        "inside" => Ok(Some(View::Inside)),
        "outside" => Ok(Some(View::Outside)),
        "either" => Ok(Some(View::Either)),
        other => Err(value_error(format!("unknown view '{other}'"))),
    }
}

/// Pixels with a measurement, row by row, and their points (N, 3) in metres (Eqs. 1 and 2).
#[pyfunction]
fn back_project<'py>(
    py: Python<'py>,
    depth: DepthArray<'py>,
    camera: &Bound<'py, PyAny>,
    rays: Option<Doubles<'py>>,
    unit: f64,
    mask: Option<PyReadonlyArray2<'py, bool>>,
) -> PyResult<(Indices<'py>, Vectors<'py>)> {
    let rays = rays.as_ref().map(rays_of).transpose()?;
    let mask = mask.as_ref().map(entries).transpose()?;
    let described = Described { camera: self::camera(camera)?, rays, unit, mask };
    let (pixels, points) = match &depth {
        DepthArray::Single(depth) => back_projected(py, &described.image(depth)?),
        DepthArray::Double(depth) => back_projected(py, &described.image(depth)?),
        DepthArray::Raw(depth) => back_projected(py, &described.image(depth)?),
    };
    let pixels: Vec<u32> = pixels.into_iter().map(|pixel| pixel as u32).collect();
    Ok((pixels.into_pyarray(py), to_array(py, &points)?))
}

fn back_projected<T: Depth>(py: Python<'_>, image: &DepthImage<T>) -> (Vec<usize>, Vec<Vec3>) {
    py.detach(|| depth_image::back_project(image))
}

fn rays_of<'a>(rays: &'a Doubles) -> PyResult<&'a [[f64; 2]]> {
    match entries(rays)?.as_chunks() {
        (rays, []) => Ok(rays),
        _ => Err(value_error("rays must have the shape (H*W, 2)")),
    }
}

/// Mean point of every occupied voxel (M, 3), in order of the voxels, and the number of points behind each.
#[pyfunction]
fn voxel_grid<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    size: f64,
    threads: usize,
) -> PyResult<(Vectors<'py>, Indices<'py>)> {
    let points = vectors(&points)?;
    let cloud = py.detach(|| grid::voxel_grid(points.as_slice(), size, &Workers::new(threads))).map_err(value_error)?;
    Ok((to_array(py, &cloud.points)?, cloud.counts.into_pyarray(py)))
}

/// Indices (N, k) of the k nearest other points, nearest first.
#[pyfunction]
fn nearest_neighbours<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    k: usize,
    threads: usize,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let points = vectors(&points)?;
    let found = py.detach(|| neighbours::nearest_neighbours(&points, k, &Workers::new(threads)));
    let found = found.map_err(value_error)?;
    PyArray1::from_slice(py, found.indices()).reshape([points.len(), found.k()])
}

/// Unit normals (N, 3), turned towards the camera at the origin.
#[pyfunction]
fn hoppe_normals<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    neighbours: PyReadonlyArray2<'py, u32>,
    threads: usize,
) -> PyResult<Vectors<'py>> {
    let points = vectors(&points)?;
    let near = near(&neighbours, points.len())?;
    to_array(py, &py.detach(|| normals::normals(&points, &near, &Workers::new(threads))))
}

/// Principal curvatures k1 and k2 (N,) and principal directions E1 and E2 (N, 3).
#[pyfunction]
#[allow(clippy::type_complexity)]
fn shape_tensors<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    neighbours: PyReadonlyArray2<'py, u32>,
    normals: Doubles<'py>,
    threads: usize,
) -> PyResult<(Numbers<'py>, Numbers<'py>, Vectors<'py>, Vectors<'py>)> {
    let (points, normals) = (vectors(&points)?, vectors(&normals)?);
    same_length("normals", normals.len(), points.len())?;
    let near = near(&neighbours, points.len())?;
    let tensors = py.detach(|| shape_tensor::tensors::shape_tensors(&points, &near, &normals, &Workers::new(threads)));
    let number = |of: fn(&ShapeTensor) -> f64| tensors.iter().map(of).collect::<Vec<_>>().into_pyarray(py);
    let vector = |of: fn(&ShapeTensor) -> Vec3| to_array(py, &tensors.iter().map(of).collect::<Vec<_>>());
    Ok((number(|t| t.k1), number(|t| t.k2), vector(|t| t.e1)?, vector(|t| t.e2)?))
}

/// Indices of the candidates in order of rising |k2|, and their directions E1 (C, 3).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn select_candidates<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    neighbours: PyReadonlyArray2<'py, u32>,
    k1: PyReadonlyArray1<'py, f64>,
    k2: PyReadonlyArray1<'py, f64>,
    e1: Doubles<'py>,
    e2: Doubles<'py>,
    share: f64,
    view: &str,
) -> PyResult<(Indices<'py>, Vectors<'py>)> {
    let (points, e1, e2) = (vectors(&points)?, vectors(&e1)?, vectors(&e2)?);
    let (k1, k2, view) = (k1.as_array(), k2.as_array(), self::view(view)?.unwrap_or_default());
    for (what, got) in [("k1", k1.len()), ("k2", k2.len()), ("E1", e1.len()), ("E2", e2.len())] {
        same_length(what, got, points.len())?;
    }
    let directions = e1.into_iter().zip(e2);
    let tensors: Vec<ShapeTensor> = k1
        .iter()
        .zip(k2)
        .zip(directions)
        .map(|((k1, k2), (e1, e2))| ShapeTensor { k1: *k1, k2: *k2, e1, e2 })
        .collect();
    let near = near(&neighbours, points.len())?;
    let found = candidates::select_candidates(&points, &near, &tensors, share, view, &Workers::new(1));
    let index: Vec<u32> = found.iter().map(|c| c.index as u32).collect();
    Ok((index.into_pyarray(py), to_array(py, &found.iter().map(|c| c.e1).collect::<Vec<_>>())?))
}

/// Axis direction X and the rising eigenvalues of S/n (Eq. 3).
#[pyfunction]
fn axis_direction(e1: Doubles) -> PyResult<([f64; 3], [f64; 3])> {
    let direction = axis::axis_direction(vectors(&e1)?);
    Ok((direction.x.into(), direction.spread))
}

/// Axis direction X of the candidates' directions E1, in order of rising |k2|, and which of them agree with it.
#[pyfunction]
fn consistent_direction<'py>(py: Python<'py>, e1: Doubles, agreement: f64) -> PyResult<([f64; 3], Indices<'py>)> {
    let candidate = |(index, e1)| Candidate { index, bent: f64::NAN, straight: f64::NAN, e1 };
    let candidates: Vec<Candidate> = vectors(&e1)?.into_iter().enumerate().map(candidate).collect();
    let found = axis::consistent_direction(&candidates, agreement);
    Ok((found.direction.x.into(), found.kept.iter().map(|c| c.index as u32).collect::<Vec<_>>().into_pyarray(py)))
}

/// Estimated axis points (M, 2) in the silo's x and y (Eq. 4).
#[pyfunction]
fn axis_points<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    normals: Doubles<'py>,
    direction: [f64; 3],
    partners: usize,
    threads: usize,
) -> PyResult<Vectors<'py>> {
    let (points, normals) = (vectors(&points)?, vectors(&normals)?);
    same_length("normals", normals.len(), points.len())?;
    let walls: Vec<Wall> = points.into_iter().zip(normals).map(|(p, normal)| Wall { p, normal }).collect();
    let estimates = py.detach(|| axis::axis_points(&walls, &direction.into(), partners, &Workers::new(threads)));
    let flat: Vec<f64> = estimates.iter().flat_map(|e| [e.at.x, e.at.y]).collect();
    flat.into_pyarray(py).reshape([estimates.len(), 2])
}

/// The six steps' settings: grid, neighbours, view, share, agreement, partners, threads.
type Settings<'a> = (f64, usize, &'a str, f64, f64, usize, usize);

fn settings(
    (grid, neighbours, view, share, agreement, partners, threads): Settings,
) -> PyResult<shape_tensor::Settings> {
    Ok(shape_tensor::Settings { grid, neighbours, view: self::view(view)?, share, agreement, partners, threads })
}

/// Runs the six steps on a depth image: a dictionary of plain numbers, or only the reason for a refusal, as `refusal`.
#[pyfunction]
fn shape_tensor_image<'py>(
    py: Python<'py>,
    depth: DepthArray<'py>,
    camera: &Bound<'py, PyAny>,
    rays: Option<Doubles<'py>>,
    unit: f64,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    settings: Settings,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = self::settings(settings)?;
    let rays = rays.as_ref().map(rays_of).transpose()?;
    let mask = mask.as_ref().map(entries).transpose()?;
    let described = Described { camera: self::camera(camera)?, rays, unit, mask };
    match &depth {
        DepthArray::Single(depth) => located(py, &described.image(depth)?, &settings),
        DepthArray::Double(depth) => located(py, &described.image(depth)?, &settings),
        DepthArray::Raw(depth) => located(py, &described.image(depth)?, &settings),
    }
}

fn located<'py, T: Depth>(
    py: Python<'py>,
    image: &DepthImage<T>,
    settings: &shape_tensor::Settings,
) -> PyResult<Bound<'py, PyDict>> {
    outcome(py, py.detach(|| shape_tensor::locate_in_image(image, settings)).map_err(value_error)?)
}

/// Runs the six steps on points (N, 3), metres, seen from the origin; rows that aren't finite are left out.
#[pyfunction]
fn shape_tensor_points<'py>(py: Python<'py>, points: Doubles, settings: Settings) -> PyResult<Bound<'py, PyDict>> {
    let (points, settings) = (vectors(&points)?, self::settings(settings)?);
    outcome(py, py.detach(|| shape_tensor::locate_in_points(&points, &settings)).map_err(value_error)?)
}

fn outcome(py: Python<'_>, found: Outcome) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    let found = match found {
        Ok(found) => found,
        Err(refusal) => {
            out.set_item("refusal", refusal.slug())?;
            return Ok(out);
        }
    };
    let (pose, profile, e) = (found.pose, found.profile, found.evidence);
    out.set_item("pose", (pose.r_x, pose.r_y, pose.t_x, pose.t_y))?;
    out.set_item("covariance", PyArray1::from_slice(py, found.covariance.as_slice()).reshape([4, 4])?)?;
    out.set_item("radius", profile.radius.map(|radius| (radius, profile.radius_std)))?;
    out.set_item("apex", profile.cone.map(|cone| (cone.apex, profile.apex_std())))?;
    out.set_item("bottom", profile.bottom().map(|bottom| (bottom, profile.bottom_std())))?;
    out.set_item("misfit", profile.misfit)?;
    out.set_item("pixels", found.coverage.pixels)?;
    out.set_item("areas", found.coverage.areas)?;
    let evidence = PyDict::new(py);
    for (key, count) in [("points", e.points), ("candidates", e.candidates), ("walls", e.walls)] {
        evidence.set_item(key, count)?;
    }
    let measures = [("around", e.around), ("along", e.along), ("miss", e.miss), ("turn", e.turn), ("bend", e.bend)];
    for (key, value) in measures.into_iter().chain([("behind", e.behind)]) {
        evidence.set_item(key, value)?;
    }
    out.set_item("evidence", evidence)?;
    out.set_item("timing", found.timing)?;
    Ok(out)
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(back_project, m)?)?;
    m.add_function(wrap_pyfunction!(voxel_grid, m)?)?;
    m.add_function(wrap_pyfunction!(nearest_neighbours, m)?)?;
    m.add_function(wrap_pyfunction!(hoppe_normals, m)?)?;
    m.add_function(wrap_pyfunction!(shape_tensors, m)?)?;
    m.add_function(wrap_pyfunction!(select_candidates, m)?)?;
    m.add_function(wrap_pyfunction!(axis_direction, m)?)?;
    m.add_function(wrap_pyfunction!(consistent_direction, m)?)?;
    m.add_function(wrap_pyfunction!(axis_points, m)?)?;
    m.add_function(wrap_pyfunction!(shape_tensor_image, m)?)?;
    m.add_function(wrap_pyfunction!(shape_tensor_points, m)?)
}
