//! The surface fit's result: to add a number, add a getter here and a line to `_core.pyi`.

use super::warm_start::WarmStart;
use crate::arrays::{matrix, vectors};
use crate::frame_factor::FrameFactor;
use crate::inputs::DepthFrame;
use crate::outcome::{StageTime, stages};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use siloscope::Vec3;
use siloscope::surface_fit::diagnostics::WallEvidence;
use siloscope::surface_fit::segmentation::{self, label_pixels};
use siloscope::surface_fit::tiles::Patches;

/// A wall fitted to a frame. Radians and metres; parameters in the order of `siloscope.parameters.PARAMETERS`.
#[pyclass(frozen, module = "siloscope._core")]
pub struct SurfaceFit {
    fit: Box<siloscope::surface_fit::SurfaceFit>,
    points: Vec<Vec3>,
    coverage: Option<segmentation::Coverage>,
    cloud: bool,
}

impl SurfaceFit {
    /// Keeps of a fit what its getters need; `coverage` is worked out where it is wanted.
    pub fn new(mut fit: siloscope::surface_fit::SurfaceFit, coverage: bool) -> Self {
        let (points, cloud) = (fit.patch_points(), fit.patches.cloud);
        let coverage = coverage.then(|| segmentation::coverage(&fit));
        fit.patches = Patches::default();
        Self { fit: Box::new(fit), points, coverage, cloud }
    }
}

#[pymethods]
impl SurfaceFit {
    /// Wall and depth bias (12,); NaN for a part that was not seen.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.fit.fit.surface.parameters(&self.fit.fit.bias).as_slice())
    }

    /// Covariance (12, 12) of the parameters; zero rows for those that are not free.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.fit.covariance)
    }

    /// Which parameters (12,) were estimated.
    #[getter]
    fn free<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.fit.free)
    }

    /// Whether the wall is seen from inside.
    #[getter]
    fn inside(&self) -> bool {
        self.fit.fit.inside
    }

    /// Standard deviation of the wall about its model beyond the sensor's noise, m.
    #[getter]
    fn model_error_std(&self) -> f64 {
        self.fit.fit.misfit
    }

    /// Scatter of the tiles' residuals over its expectation (reduced chi-square).
    #[getter]
    fn chi_square(&self) -> f64 {
        self.fit.chi_square
    }

    /// Tiles in the silo frame (N, 3), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.points)
    }

    /// Distance (N,) of each tile from the wall, m; NaN where it is not wall.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.fit.residuals)
    }

    /// Vessel models that were weighed, with their probabilities; none for clouds and views from outside.
    #[getter]
    fn models(&self) -> Vec<(&'static str, f64)> {
        let models = self.fit.joint.as_ref().map(|joint| joint.answer.models.as_slice());
        models.unwrap_or_default().iter().map(|(model, probability)| (model.slug(), *probability)).collect()
    }

    /// Errors of the given intrinsics as the frame shows them: fx and fy (relative), cx and cy in units of the rays, k1;
    /// None where they count as exact.
    #[getter]
    fn camera_error(&self) -> Option<[f64; 5]> {
        self.fit.joint.as_ref().map(|joint| joint.answer.camera)
    }

    /// Covariance (12, 12) if the intrinsics were exact: without what all frames of a camera have in common.
    #[getter]
    fn covariance_relative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, self.fit.joint.as_ref().map_or(&self.fit.covariance, |joint| &joint.answer.relative))
    }

    /// What was measured on the wall's tiles.
    #[getter]
    fn diagnostics(&self) -> WallDiagnostics {
        WallDiagnostics(self.fit.evidence)
    }

    /// What this frame alone says, for fusing frames.
    #[getter]
    fn factor(&self) -> FrameFactor {
        FrameFactor(self.fit.factor.clone())
    }

    /// Where other frames of the camera may look for the wall first; None for clouds.
    #[getter]
    fn warm_start(&self) -> Option<WarmStart> {
        (!self.cloud).then_some(WarmStart(self.fit.wall))
    }

    /// How much of the frame each label covers; None where that was not asked for.
    #[getter]
    fn coverage(&self) -> Option<Coverage> {
        self.coverage.clone().map(Coverage)
    }

    /// The stages of the fit with their times, in order.
    #[getter]
    fn stages(&self) -> Vec<StageTime> {
        stages(&self.fit.timing)
    }

    /// Label of each pixel (H, W) of the frame that was fitted: 0 none, 1 cylinder, 2 cone, 3 feed, 4 other.
    fn labels<'py>(&self, py: Python<'py>, frame: DepthFrame<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let buffers = frame.metres()?;
        let image = buffers.image()?;
        let labels = py.detach(|| label_pixels(&image, &self.fit));
        PyArray1::from_vec(py, labels).reshape([image.height, image.width])
    }
}

/// What was measured on the wall's tiles, by which a frame without wall is refused.
#[pyclass(frozen, module = "siloscope._core")]
pub struct WallDiagnostics(WallEvidence);

#[pymethods]
impl WallDiagnostics {
    /// Number of wall tiles.
    #[getter]
    fn tiles(&self) -> usize {
        self.0.patches
    }

    /// Turn of the normal per turn of the position about the axis: 1 on a wall of revolution, 0 on a plane.
    #[getter]
    fn turn(&self) -> f64 {
        self.0.turn
    }

    /// Turn of the normal along the generatrix, in units of 1/R: 0 on cylinder and cone, 1 on a sphere.
    #[getter]
    fn bend(&self) -> f64 {
        self.0.bend
    }

    /// Angle about the axis that the wall tiles cover, rad.
    #[getter]
    fn arc(&self) -> f64 {
        self.0.arc
    }
}

/// How much of a frame each label covers, in the order of the labels: none, cylinder, cone, feed, other.
#[pyclass(frozen, module = "siloscope._core")]
pub struct Coverage(segmentation::Coverage);

#[pymethods]
impl Coverage {
    /// Number of pixels with each label.
    #[getter]
    fn counts(&self) -> [f64; 5] {
        self.0.counts
    }

    /// Surface with each label, m².
    #[getter]
    fn areas(&self) -> [f64; 5] {
        self.0.areas
    }
}
