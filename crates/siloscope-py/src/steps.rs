//! The paper's six steps, one function each.

use crate::arrays::{self, in_c_order};
use crate::convert::value_error;
use crate::inputs::{DepthArray, DepthFrame, FrameBuffers};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope::base::workers::Workers;
use siloscope::geometry::depth_image::{self, Depth};
use siloscope::geometry::normals;
use siloscope::geometry::view::View;
use siloscope::shape_tensor;
use siloscope::shape_tensor::axis::{self, Wall};
use siloscope::shape_tensor::candidates::{self, Candidate};
use siloscope::shape_tensor::tensors::ShapeTensor;
use siloscope::stats::neighbours::Neighbours;
use siloscope::stats::{neighbours, voxel_grid as grid};

pub type Doubles<'py> = PyReadonlyArray2<'py, f64>;
type Vectors<'py> = Bound<'py, PyArray2<f64>>;
type Numbers<'py> = Bound<'py, PyArray1<f64>>;

pub fn vectors(array: &Doubles) -> PyResult<Vec<Vec3>> {
    Ok(arrays::points(array)?.into_iter().map(Vec3::from).collect())
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
    Neighbours::from_indices(*k, in_c_order(neighbours)?.into_owned(), n).map_err(value_error)
}

/// A view by name; None for "auto".
pub fn view(name: &str) -> PyResult<Option<View>> {
    match name {
        "auto" => Ok(None),
        "inside" => Ok(Some(View::Inside)),
        "outside" => Ok(Some(View::Outside)),
        "either" => Ok(Some(View::Either)),
        other => Err(value_error(format!("unknown view '{other}'"))),
    }
}

/// Points (N, 3) in metres of the pixels with a measurement, row by row (Eqs. 1 and 2).
#[pyfunction]
fn back_project<'py>(py: Python<'py>, frame: DepthFrame<'py>) -> PyResult<Vectors<'py>> {
    match &frame.depth {
        DepthArray::Single(depth) => back_projected(py, &frame.buffers(depth)?),
        DepthArray::Double(depth) => back_projected(py, &frame.buffers(depth)?),
        DepthArray::Raw(depth) => back_projected(py, &frame.buffers(depth)?),
    }
}

fn back_projected<'py, T: Depth>(py: Python<'py>, buffers: &FrameBuffers<T>) -> PyResult<Vectors<'py>> {
    let image = buffers.image()?;
    arrays::vectors(py, &py.detach(|| depth_image::back_project(&image)).1)
}

/// Mean point of every occupied voxel (M, 3), in order of the voxels.
#[pyfunction]
fn voxel_grid<'py>(py: Python<'py>, points: Doubles<'py>, size: f64, threads: usize) -> PyResult<Vectors<'py>> {
    let points = vectors(&points)?;
    let cloud = py.detach(|| grid::voxel_grid(points.as_slice(), size, &Workers::new(threads))).map_err(value_error)?;
    arrays::vectors(py, &cloud.points)
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
    arrays::vectors(py, &py.detach(|| normals::normals(&points, &near, &Workers::new(threads))))
}

/// Shape tensors of N points: principal curvatures and directions.
#[pyclass(frozen, module = "siloscope._core")]
struct ShapeTensors(Vec<ShapeTensor>);

impl ShapeTensors {
    fn numbers<'py>(&self, py: Python<'py>, of: fn(&ShapeTensor) -> f64) -> Numbers<'py> {
        PyArray1::from_iter(py, self.0.iter().map(of))
    }

    fn directions<'py>(&self, py: Python<'py>, of: fn(&ShapeTensor) -> Vec3) -> PyResult<Vectors<'py>> {
        arrays::vectors(py, &self.0.iter().map(of).collect::<Vec<_>>())
    }
}

#[pymethods]
impl ShapeTensors {
    /// Greater principal curvature (N,), 1/m.
    #[getter]
    fn k1<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |tensor| tensor.k1)
    }

    /// Smaller principal curvature (N,), 1/m.
    #[getter]
    fn k2<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        self.numbers(py, |tensor| tensor.k2)
    }

    /// Unit direction (N, 3) of `k1`.
    #[getter(E1)]
    fn e1<'py>(&self, py: Python<'py>) -> PyResult<Vectors<'py>> {
        self.directions(py, |tensor| tensor.e1)
    }

    /// Unit direction (N, 3) of `k2`.
    #[getter(E2)]
    fn e2<'py>(&self, py: Python<'py>) -> PyResult<Vectors<'py>> {
        self.directions(py, |tensor| tensor.e2)
    }
}

/// Shape tensors of points (N, 3) with their neighbours (N, k) and normals (N, 3).
#[pyfunction]
fn shape_tensors<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    neighbours: PyReadonlyArray2<'py, u32>,
    normals: Doubles<'py>,
    threads: usize,
) -> PyResult<ShapeTensors> {
    let (points, normals) = (vectors(&points)?, vectors(&normals)?);
    same_length("normals", normals.len(), points.len())?;
    let near = near(&neighbours, points.len())?;
    let threads = &Workers::new(threads);
    Ok(ShapeTensors(py.detach(|| shape_tensor::tensors::shape_tensors(&points, &near, &normals, threads))))
}

/// `siloscope.estimation.steps.ShapeTensors`.
#[derive(FromPyObject)]
struct TensorArrays<'py> {
    k1: PyReadonlyArray1<'py, f64>,
    k2: PyReadonlyArray1<'py, f64>,
    #[pyo3(attribute("E1"))]
    e1: Doubles<'py>,
    #[pyo3(attribute("E2"))]
    e2: Doubles<'py>,
}

impl TensorArrays<'_> {
    /// The tensors of `n` points.
    fn tensors(&self, n: usize) -> PyResult<Vec<ShapeTensor>> {
        let (k1, k2, e1, e2) = (in_c_order(&self.k1)?, in_c_order(&self.k2)?, vectors(&self.e1)?, vectors(&self.e2)?);
        for (what, got) in [("k1", k1.len()), ("k2", k2.len()), ("E1", e1.len()), ("E2", e2.len())] {
            same_length(what, got, n)?;
        }
        let curvatures = k1.iter().zip(k2.iter());
        let tensor = |((k1, k2), (e1, e2)): ((&f64, &f64), (Vec3, Vec3))| ShapeTensor { k1: *k1, k2: *k2, e1, e2 };
        Ok(curvatures.zip(e1.into_iter().zip(e2)).map(tensor).collect())
    }
}

/// Points that may lie on the walls, in order of rising |k2|.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct Candidates {
    /// Their indices (C,).
    index: Py<PyArray1<u32>>,
    /// Their directions (C, 3).
    #[pyo3(name = "E1")]
    e1: Py<PyArray2<f64>>,
}

/// The candidates among points (N, 3) with their neighbours (N, k) and shape tensors.
#[pyfunction]
fn select_candidates<'py>(
    py: Python<'py>,
    points: Doubles<'py>,
    neighbours: PyReadonlyArray2<'py, u32>,
    tensors: TensorArrays<'py>,
    share: f64,
    view: &str,
) -> PyResult<Candidates> {
    let points = vectors(&points)?;
    let (tensors, near) = (tensors.tensors(points.len())?, near(&neighbours, points.len())?);
    let view = self::view(view)?.unwrap_or_default();
    let threads = &Workers::new(1);
    let found = py.detach(|| candidates::select_candidates(&points, &near, &tensors, share, view, threads));
    let index: Vec<u32> = found.iter().map(|c| c.index as u32).collect();
    let e1 = arrays::vectors(py, &found.iter().map(|c| c.e1).collect::<Vec<_>>())?.unbind();
    Ok(Candidates { index: index.into_pyarray(py).unbind(), e1 })
}

/// Axis direction X of directions E1 (C, 3): eigenvector of the smallest eigenvalue of Σ E1 E1ᵀ (Eq. 3).
#[pyfunction]
fn axis_direction(e1: Doubles) -> PyResult<[f64; 3]> {
    Ok(axis::axis_direction(vectors(&e1)?).x.into())
}

/// Axis direction, and the candidates behind it.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct ConsistentDirection {
    /// Unit vector X, z > 0.
    #[pyo3(name = "X")]
    x: [f64; 3],
    /// Numbers (M,) of the candidates that agree with it.
    agreeing: Py<PyArray1<u32>>,
}

/// Axis direction X of the candidates' directions E1, in order of rising |k2|, and which of them agree with it.
#[pyfunction]
fn consistent_direction(py: Python<'_>, e1: Doubles, agreement: f64) -> PyResult<ConsistentDirection> {
    let candidate = |(index, e1)| Candidate { index, bent: f64::NAN, straight: f64::NAN, e1 };
    let candidates: Vec<Candidate> = vectors(&e1)?.into_iter().enumerate().map(candidate).collect();
    let found = py.detach(|| axis::consistent_direction(&candidates, agreement));
    let agreeing: Vec<u32> = found.kept.iter().map(|c| c.index as u32).collect();
    Ok(ConsistentDirection { x: found.direction.x.into(), agreeing: agreeing.into_pyarray(py).unbind() })
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

/// Defaults of the six steps' settings.
#[pyclass(frozen, get_all, module = "siloscope._core")]
struct StepDefaults {
    /// Side of the voxels, m.
    grid: f64,
    /// Neighbours k.
    neighbours: usize,
    /// Fraction of the clearly curved points that are kept.
    share: f64,
    /// Robust standard deviations.
    agreement: f64,
    /// Partners s.
    partners: usize,
}

impl Default for StepDefaults {
    fn default() -> Self {
        let shape_tensor::Settings { grid, neighbours, share, agreement, partners, .. } = Default::default();
        Self { grid, neighbours, share, agreement, partners }
    }
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<StepDefaults>()?;
    m.add("STEP_DEFAULTS", StepDefaults::default())?;
    m.add_class::<ShapeTensors>()?;
    m.add_class::<Candidates>()?;
    m.add_class::<ConsistentDirection>()?;
    m.add_function(wrap_pyfunction!(back_project, m)?)?;
    m.add_function(wrap_pyfunction!(voxel_grid, m)?)?;
    m.add_function(wrap_pyfunction!(nearest_neighbours, m)?)?;
    m.add_function(wrap_pyfunction!(hoppe_normals, m)?)?;
    m.add_function(wrap_pyfunction!(shape_tensors, m)?)?;
    m.add_function(wrap_pyfunction!(select_candidates, m)?)?;
    m.add_function(wrap_pyfunction!(axis_direction, m)?)?;
    m.add_function(wrap_pyfunction!(consistent_direction, m)?)?;
    m.add_function(wrap_pyfunction!(axis_points, m)?)
}
