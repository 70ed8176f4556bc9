//! The content's numbers: to add one, add a getter here and a line to `_core.pyi`.

use super::surface::ContentSurface;
use numpy::PyArray1;
use pyo3::prelude::*;
use siloscope::content::Content;
use siloscope::content::cells::Counts;
use siloscope::content::classify::Thing;
use siloscope::content::shape::{self, Form};
use siloscope::content::uncertainty::UncertaintyBudget;
use siloscope::content::visibility::Visibility;
use siloscope::content::volume::{Kind, Volume};
use siloscope::content::wall_shift::Shift;

/// What the core measured of a frame's content. Metres, square and cubic metres, z down in the silo frame.
#[pyclass(frozen, get_all, module = "siloscope._core")]
pub struct ContentMeasure {
    /// The volume; None where there is no surface.
    volume: Option<SurfaceVolume>,
    /// Standard deviations of the volume.
    std: VolumeStd,
    /// Derivatives (10,) of the volume by the calibration's parameters.
    derivatives: Py<PyArray1<f64>>,
    /// Number of cells by what they show.
    cells: CellCounts,
    /// Components above the surface, by size.
    things: Vec<Component>,
    /// Steep holes in it, by size.
    holes: Vec<Component>,
    /// How the seen part lies; None where it is too small.
    shape: Option<Shape>,
    /// Where the bare floor is seen; None where it is not.
    bare: Option<BareFloor>,
    /// Most that the unseen floor can hide where no surface is seen, m³; else 0.
    hidden: f64,
    /// Fraction of the seen cells surely below the floor.
    sunken: f64,
    /// Counts of the returns.
    returns: ReturnCounts,
    /// How much the sensor sees.
    visibility: Sight,
    /// Change of the wall since the calibration; None where too little of it is seen.
    shift: Option<WallShift>,
    /// The surface; None where hardly any cell shows content.
    surface: Option<Py<ContentSurface>>,
}

impl ContentMeasure {
    /// Takes a content apart.
    pub fn new(py: Python<'_>, content: Content) -> PyResult<Self> {
        let cell_area = content.grid.cell().powi(2);
        let components = |found: &[Thing]| found.iter().map(|thing| Component::new(thing, cell_area)).collect();
        Ok(Self {
            volume: content.volume.as_ref().map(SurfaceVolume::from),
            std: content.doubts.into(),
            derivatives: PyArray1::from_slice(py, content.derivatives.as_slice()).unbind(),
            cells: CellCounts::new(&content.kinds),
            things: components(&content.things),
            holes: components(&content.holes),
            shape: content.shape.map(Shape),
            bare: content.bare.map(|[nearest, farthest]| BareFloor { nearest, farthest }),
            hidden: content.hidden,
            sunken: content.sunken,
            returns: (&content.tally).into(),
            visibility: content.sight.into(),
            shift: content.shift.map(WallShift::from),
            surface: ContentSurface::of_content(content).map(|surface| Py::new(py, surface)).transpose()?,
        })
    }
}

/// The volume under a surface.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct SurfaceVolume {
    /// Volume, m³.
    volume: f64,
    /// Area of the surface seen from above, m².
    area: f64,
    /// The part of it over cells that show it, m².
    seen: f64,
    /// ∫ z dA over the surface, m³.
    moment: f64,
    /// Least z of the surface.
    highest: f64,
    /// Greatest z of the surface.
    lowest: f64,
    /// Mean z where it meets the wall or the cone; None where it does not.
    at_wall: Option<f64>,
    /// Fraction of the circle at which it reaches the cylinder.
    wall_fraction: f64,
    /// Greatest distance of the content's rim from the axis.
    reach: f64,
    /// What a standard deviation of a mapped floor that is common to all of it does to the volume, m³.
    floor_std: f64,
    /// Area over which content or bare mapped floor counts, m².
    counted: f64,
}

impl From<&Volume> for SurfaceVolume {
    fn from(v: &Volume) -> Self {
        let Volume {
            volume, area, seen, moment, extremes: [highest, lowest], at_wall, reach, floor_std, counted, ..
        } = *v;
        let wall_fraction = v.wall_share;
        Self { volume, area, seen, moment, highest, lowest, at_wall, wall_fraction, reach, floor_std, counted }
    }
}

/// Standard deviations of the volume by cause, m³.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct VolumeStd {
    /// The camera's pose.
    pose: f64,
    /// The silo's lengths.
    geometry: f64,
    /// The sensor's systematic depth error.
    depth: f64,
    /// The sensor's noise.
    noise: f64,
    /// What is not seen of the surface.
    unseen: f64,
    /// The map's cells.
    grid: f64,
    /// All together, with the correlations of pose, geometry and depth.
    total: f64,
}

impl From<UncertaintyBudget> for VolumeStd {
    fn from(budget: UncertaintyBudget) -> Self {
        let UncertaintyBudget { pose, geometry, depth, noise, unseen, grid, total } = budget;
        Self { pose, geometry, depth, noise, unseen, grid, total }
    }
}

/// Number of cells by what they show.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct CellCounts {
    /// Nothing.
    unseen: usize,
    /// Content.
    content: usize,
    /// The content's rim.
    rim: usize,
    /// The bare floor.
    bare: usize,
    /// Something else.
    other: usize,
}

impl CellCounts {
    fn new(kinds: &[Kind]) -> Self {
        let count = |kind: Kind| kinds.iter().filter(|k| **k == kind).count();
        Self {
            unseen: count(Kind::Unseen),
            content: count(Kind::Feed),
            rim: count(Kind::Rim),
            bare: count(Kind::Bare),
            other: count(Kind::Clutter),
        }
    }
}

/// Neighbouring cells that steep steps part from the surface.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct Component {
    /// Area seen from above, m².
    area: f64,
    /// Mean height above the surface's trend; negative for a hole.
    above: f64,
    /// Whether it reaches the silo's wall.
    at_wall: bool,
}

impl Component {
    fn new(thing: &Thing, cell_area: f64) -> Self {
        Self { area: thing.cells.len() as f64 * cell_area, above: thing.above, at_wall: thing.at_wall }
    }
}

/// Distances from the axis of the cells that show the bare floor.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct BareFloor {
    /// Of the nearest.
    nearest: f64,
    /// Of the farthest.
    farthest: f64,
}

/// Counts of a frame's returns.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct ReturnCounts {
    /// All of them.
    total: f64,
    /// On the wall.
    wall: f64,
    /// Outside the wall.
    outside: f64,
    /// Above the surface.
    above: f64,
    /// Those of them whose neighbours lie about as deep.
    coherent: f64,
}

impl From<&Counts> for ReturnCounts {
    fn from(counts: &Counts) -> Self {
        let Counts { returns: total, wall, outside, above, coherent, .. } = *counts;
        Self { total, wall, outside, above, coherent }
    }
}

/// How much the sensor sees.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct Sight {
    /// Fraction of the pixels or points with a measurement.
    measured: f64,
    /// Fraction of the image's tiles that look at the silo within range and show next to nothing.
    blind: f64,
    /// Fraction of the measurements far nearer than the sensor can measure.
    near: f64,
}

impl From<Visibility> for Sight {
    fn from(Visibility { measured, blind, near }: Visibility) -> Self {
        Self { measured, blind, near }
    }
}

/// Change of the pose that would explain where the wall is seen.
#[pyclass(frozen, get_all, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct WallShift {
    /// Of r_x, r_y, t_x and t_y.
    change: [f64; 4],
    /// Their standard deviations: the fit's own and the calibration's.
    std: [f64; 4],
    /// Root mean square distance of the wall's returns from the calibration's wall, m.
    rms_before: f64,
    /// The same with the change taken out.
    rms_after: f64,
}

impl From<Shift> for WallShift {
    fn from(Shift { change, std, rms, left }: Shift) -> Self {
        Self { change, std, rms_before: rms, rms_after: left }
    }
}

/// How a surface lies as a whole, heights upwards.
#[pyclass(frozen, from_py_object, module = "siloscope._core")]
#[derive(Clone, Copy)]
pub struct Shape(pub shape::Shape);

const FORMS: [(Form, &str); 5] = [
    (Form::Flat, "flat"),
    (Form::Tilted, "tilted"),
    (Form::Mound, "mound"),
    (Form::Funnel, "funnel"),
    (Form::Irregular, "irregular"),
];

impl Shape {
    /// As plain numbers: index of the form, flank, steepness, centre, tilt, asymmetry, irregularity.
    pub fn numbers(self) -> [f64; 9] {
        let shape::Shape { form, flank, steepness, centre, tilt, asymmetry, irregularity } = self.0;
        let index = FORMS.iter().position(|(known, _)| *known == form).unwrap_or_default();
        let [x, y] = centre.unwrap_or([f64::NAN; 2]);
        [index as f64, flank, steepness, x, y, tilt[0], tilt[1], asymmetry, irregularity]
    }

    /// From plain numbers.
    pub fn from_numbers([index, flank, steepness, x, y, u, v, asymmetry, irregularity]: [f64; 9]) -> Self {
        let form = FORMS.get(index as usize).map_or(Form::Irregular, |(form, _)| *form);
        let centre = Some([x, y]).filter(|_| !x.is_nan());
        Self(shape::Shape { form, flank, steepness, centre, tilt: [u, v], asymmetry, irregularity })
    }
}

#[pymethods]
impl Shape {
    /// "flat", "tilted", "mound", "funnel" or "irregular".
    #[getter]
    fn form(&self) -> &'static str {
        FORMS.iter().find(|(form, _)| *form == self.0.form).map_or("irregular", |(_, name)| name)
    }

    /// Mean rise of the flank away from the centre, as a tangent; negative for a mound.
    #[getter]
    fn flank(&self) -> f64 {
        self.0.flank
    }

    /// Mean steepness, whatever its direction, as a tangent.
    #[getter]
    fn steepness(&self) -> f64 {
        self.0.steepness
    }

    /// Where the lines of steepest slope meet (x, y), m; None where they don't.
    #[getter]
    fn centre(&self) -> Option<(f64, f64)> {
        self.0.centre.map(Into::into)
    }

    /// Mean rise along x and y, as tangents.
    #[getter]
    fn tilt(&self) -> (f64, f64) {
        self.0.tilt.into()
    }

    /// Fraction of the height's variance that a profile about the axis does not explain.
    #[getter]
    fn asymmetry(&self) -> f64 {
        self.0.asymmetry
    }

    /// The same for a profile about the centre.
    #[getter]
    fn irregularity(&self) -> f64 {
        self.0.irregularity
    }
}
