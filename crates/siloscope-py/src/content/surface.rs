//! The content's surface as a map.

use super::result::Shape;
use crate::arrays::in_c_order;
use crate::convert::value_error;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use siloscope::content::basis::Basis;
use siloscope::content::cells::Cell;
use siloscope::content::cloud::Relief;
use siloscope::content::fit::Surface;
use siloscope::content::grid::Grid;
use siloscope::content::heights::Heights;
use siloscope::content::volume::Kind;
use siloscope::content::{Content, shape_of};
use std::sync::OnceLock;

/// The surface of one frame or cloud, z down from its own zero. A pickle holds what is needed for every value.
#[pyclass(frozen, eq, module = "siloscope._core")]
pub struct ContentSurface {
    heights: Heights,
    kinds: Vec<u8>,
    placed: Placed,
    std: OnceLock<Vec<f64>>,
    shape: OnceLock<Option<Shape>>,
    /// What deviations and shape are worked out from; None once they stand.
    fitted: Option<(Surface, Vec<Cell>)>,
}

/// How a map's own axes lie in the cloud.
#[derive(Clone, Copy, PartialEq)]
struct Placed {
    /// Height of z = 0 over the cloud's own zero; 0 for a silo.
    ceiling: f64,
    /// Rows: the two horizontal axes and up.
    axes: [[f64; 3]; 3],
}

const STANDING: Placed = Placed { ceiling: 0.0, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

/// Numbers of `ContentSurface.layout`: centre, reach and side of the grid, datum, centre of the basis, ceiling, axes.
const LAYOUT: usize = 17;

/// The arguments of `ContentSurface`.
type State<'py> = (
    [f64; LAYOUT],
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<f64>>,
    Option<[f64; 9]>,
);

impl ContentSurface {
    /// The surface of a silo's content, where there is one.
    pub fn of_content(content: Content) -> Option<Self> {
        let surface = content.surface?;
        Some(Self::new_fitted(surface, content.cells, &content.kinds, STANDING))
    }

    /// The surface of a bare cloud.
    pub fn of_relief(relief: Relief) -> Self {
        let axes = [0, 1, 2].map(|i| [0, 1, 2].map(|j| relief.axes[(i, j)]));
        Self::new_fitted(relief.surface, relief.cells, &relief.kinds, Placed { ceiling: relief.ceiling, axes })
    }

    fn new_fitted(surface: Surface, cells: Vec<Cell>, kinds: &[Kind], placed: Placed) -> Self {
        let count = surface.grid.count();
        Self {
            heights: Heights::from(&surface),
            kinds: (0..count).map(|i| kinds.get(i).map_or(0, |kind| *kind as u8)).collect(),
            placed,
            std: OnceLock::new(),
            shape: OnceLock::new(),
            fitted: Some((surface, cells)),
        }
    }

    fn layout(&self) -> [f64; LAYOUT] {
        let Grid { centre: [x, y], reach, side } = self.heights.grid;
        let [u, v] = self.heights.basis.centre;
        let Placed { ceiling, axes: [a, b, c] } = self.placed;
        let mut layout = [0.0; LAYOUT];
        let head = [x, y, reach, side as f64, self.heights.datum, u, v, ceiling];
        layout.iter_mut().zip(head.into_iter().chain(a).chain(b).chain(c)).for_each(|(to, from)| *to = from);
        layout
    }

    /// Standard deviations of z in the cells, worked out once.
    fn deviations(&self) -> &[f64] {
        self.std
            .get_or_init(|| self.fitted.as_ref().map_or_else(Vec::new, |(surface, cells)| surface.deviations(cells)))
    }

    fn shape_of_seen(&self) -> Option<Shape> {
        let found = || self.fitted.as_ref().and_then(|(s, cells)| shape_of(s, cells, s.grid.reach)).map(Shape);
        *self.shape.get_or_init(found)
    }

    fn map<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        value: impl Fn(usize) -> T,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        let side = self.heights.grid.side;
        PyArray1::from_iter(py, (0..side * side).map(value)).reshape([side, side])
    }

    /// Everything but the deviations and the shape, which follow from it.
    fn bits(&self) -> impl Iterator<Item = u64> {
        let kinds = self.kinds.iter().map(|&kind| u64::from(kind));
        let numbers = self.layout().into_iter().chain(self.heights.coefficients.iter().copied());
        numbers.chain(self.heights.detail.iter().copied()).map(f64::to_bits).chain(kinds)
    }
}

impl PartialEq for ContentSurface {
    fn eq(&self, other: &Self) -> bool {
        self.bits().eq(other.bits())
    }
}

#[pymethods]
impl ContentSurface {
    #[new]
    fn new(
        layout: [f64; LAYOUT],
        coefficients: PyReadonlyArray1<'_, f64>,
        detail: PyReadonlyArray1<'_, f64>,
        kinds: PyReadonlyArray1<'_, u8>,
        std: PyReadonlyArray1<'_, f64>,
        shape: Option<[f64; 9]>,
    ) -> PyResult<Self> {
        let [x, y, reach, side, datum, u, v, ceiling, axes @ ..] = layout;
        let (kinds, std) = (in_c_order(&kinds)?.into_owned(), in_c_order(&std)?.into_owned());
        let grid = Grid { centre: [x, y], reach, side: side as usize };
        let coefficients = in_c_order(&coefficients)?.into_owned();
        let detail = in_c_order(&detail)?.into_owned();
        if !(grid.side <= 1024 && [kinds.len(), std.len()] == [grid.count(); 2]) {
            return Err(value_error(format!("{} kinds for a map of {side} by {side} cells", kinds.len())));
        }
        let mut rows = [[0.0; 3]; 3];
        rows.as_flattened_mut().copy_from_slice(&axes);
        let heights = Heights { grid, basis: Basis::new([u, v]), coefficients, datum, detail };
        let (std, shape) = (OnceLock::from(std), OnceLock::from(shape.map(Shape::from_numbers)));
        Ok(Self { heights, kinds, placed: Placed { ceiling, axes: rows }, std, shape, fitted: None })
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> State<'py> {
        let array = |values: &[f64]| PyArray1::from_slice(py, values);
        let (coefficients, detail) = (array(&self.heights.coefficients), array(&self.heights.detail));
        let (std, shape) = py.detach(|| (self.deviations(), self.shape_of_seen()));
        let kinds = PyArray1::from_slice(py, &self.kinds);
        (self.layout(), coefficients, detail, kinds, array(std), shape.map(Shape::numbers))
    }

    fn __repr__(&self) -> String {
        let Grid { side, .. } = self.heights.grid;
        format!("ContentSurface({side} x {side} cells)")
    }

    /// The square of the map's cells.
    #[getter]
    fn grid(&self) -> MapGrid {
        let Grid { centre, reach, side } = self.heights.grid;
        MapGrid { centre, reach, side }
    }

    /// Height of z = 0 over the cloud's own zero; 0 for a silo.
    #[getter]
    fn ceiling(&self) -> f64 {
        self.placed.ceiling
    }

    /// Rows: the two horizontal axes and up, in the axes of the cloud.
    #[getter]
    fn axes(&self) -> [[f64; 3]; 3] {
        self.placed.axes
    }

    /// What each cell shows (n, n): 0 nothing, 1 content, 2 content's rim, 3 bare floor, 4 something else.
    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        self.map(py, |i| self.kinds.get(i).copied().unwrap_or(0))
    }

    /// z of the surface at the cells' middles (n, n), rows along y.
    fn z<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let grid = self.heights.grid;
        let z: Vec<f64> = py.detach(|| {
            let at = |i: usize| grid.middle(i);
            (0..grid.count()).map(at).map(|[x, y]| self.heights.at(x, y)).collect()
        });
        PyArray1::from_vec(py, z).reshape([grid.side, grid.side])
    }

    /// Standard deviation of that z (n, n): what noise and the unseen leave.
    fn std<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let std = py.detach(|| self.deviations());
        self.map(py, |i| std.get(i).copied().unwrap_or(f64::NAN))
    }

    /// z of the surface at places (N, 2).
    fn z_at<'py>(&self, py: Python<'py>, places: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if places.shape()[1] != 2 {
            return Err(value_error(format!("places have shape {:?}, expected (N, 2)", places.shape())));
        }
        let places = in_c_order(&places)?;
        let z = py.detach(|| places.as_chunks::<2>().0.iter().map(|[x, y]| self.heights.at(*x, *y)).collect());
        Ok(PyArray1::from_vec(py, z))
    }

    /// Shape of the seen part, or None where it is too small.
    fn shape(&self) -> Option<Shape> {
        self.shape_of_seen()
    }
}

/// The square of a map's cells.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct MapGrid {
    /// Centre (x, y), m.
    centre: [f64; 2],
    /// Half the square's side, m.
    reach: f64,
    /// Cells along a side.
    side: usize,
}
