//! Many frames fused.

use crate::arrays::matrix;
use crate::convert::value_error;
use crate::frame_factor::{FrameFactor, GivenFactor};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use siloscope::fusion::earlier::Earlier;
use siloscope::fusion::fusion;
use siloscope::fusion::heights::Heights;
use siloscope::fusion::moves;

/// `siloscope.types.frame_factor.SummedFactor`.
#[derive(FromPyObject)]
pub struct GivenSum<'py> {
    factor: GivenFactor<'py>,
    heights: (f64, f64),
    counted: Vec<f64>,
    frames: usize,
}

impl GivenSum<'_> {
    fn earlier(&self) -> PyResult<Earlier> {
        let factor = self.factor.factor()?;
        if factor.shares.len() != self.counted.len() {
            return Err(value_error("a sum must tell for how many frames each share stands"));
        }
        let heights = Heights { form: self.heights.0, cone: self.heights.1 };
        Ok(Earlier { factor, heights, counted: self.counted.clone(), frames: self.frames })
    }
}

/// Frames added up; the fields of `siloscope.types.frame_factor.SummedFactor`.
#[pyclass(frozen, module = "siloscope._core")]
pub struct SummedFactor(Earlier);

#[pymethods]
impl SummedFactor {
    /// The sum as one factor.
    #[getter]
    fn factor(&self) -> FrameFactor {
        FrameFactor(self.0.factor.clone())
    }

    /// Heights to which the form and the cone are told, m.
    #[getter]
    fn heights(&self) -> (f64, f64) {
        (self.0.heights.form, self.0.heights.cone)
    }

    /// For how many frames each share stands, by their weights.
    #[getter]
    fn counted(&self) -> Vec<f64> {
        self.0.counted.clone()
    }

    /// Number of frames.
    #[getter]
    fn frames(&self) -> usize {
        self.0.frames
    }
}

/// Frames fused; parameters in the order of `siloscope.parameters.PARAMETERS`.
#[pyclass(frozen, module = "siloscope._core")]
pub struct Fusion {
    fusion: fusion::Fusion,
    older: Option<Earlier>,
}

#[pymethods]
impl Fusion {
    /// Wall and depth bias (12,); NaN for a part that no frame has seen.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.fusion.answer.parameters.as_slice())
    }

    /// Covariance (12, 12) of the parameters.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.fusion.answer.covariance)
    }

    /// The same (12, 12) if the intrinsics were exact.
    #[getter]
    fn covariance_relative<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.fusion.answer.relative)
    }

    /// Whether the cone is known to be the silo's own.
    #[getter]
    fn hopper(&self) -> bool {
        self.fusion.hopper
    }

    /// Vessel models with their probabilities, most probable first.
    #[getter]
    fn models(&self) -> Vec<(&'static str, f64)> {
        self.fusion.models.iter().map(|(model, probability)| (model.slug(), *probability)).collect()
    }

    /// Whether the wall's form is none of a wall.
    #[getter]
    fn deformed(&self) -> bool {
        self.fusion.deformed
    }

    /// Standard deviation of a depth scale that nothing tells.
    #[getter]
    fn scale_std(&self) -> f64 {
        self.fusion.scale_std
    }

    /// Variance of the frames' scatter over what they state; at least 1.
    #[getter]
    fn excess(&self) -> f64 {
        self.fusion.common.excess
    }

    /// Moves of the camera: number of the first frame after it, turn (rad), shift (m), significance.
    #[getter]
    fn moves(&self) -> Vec<Move> {
        self.fusion.moves.iter().copied().map(Move).collect()
    }

    /// Number of the first frame after the last move.
    #[getter]
    fn first(&self) -> usize {
        self.fusion.first
    }

    /// Weights of the frames since, 0 to 1.
    #[getter]
    fn weights(&self) -> Vec<f64> {
        self.fusion.common.weights.iter().map(|w| w[0]).collect()
    }

    /// Their distances from the answer, as the equally rare deviation of a normal variable.
    #[getter]
    fn deviations(&self) -> Vec<f64> {
        self.fusion.common.deviations.clone()
    }

    /// All but the newest frames since, added up; None where all are kept.
    #[getter]
    fn older(&self) -> Option<SummedFactor> {
        self.older.clone().map(SummedFactor)
    }
}

/// A move of the camera.
#[pyclass(frozen, module = "siloscope._core")]
pub struct Move(moves::Move);

#[pymethods]
impl Move {
    /// Number of the first frame after it.
    #[getter]
    fn index(&self) -> usize {
        self.0.index
    }

    /// Angle between the axis directions, rad.
    #[getter]
    fn turn(&self) -> f64 {
        self.0.turn
    }

    /// Change of (t_x, t_y), m.
    #[getter]
    fn shift(&self) -> f64 {
        self.0.shift
    }

    /// Squared distance of the step from none.
    #[getter]
    fn significance(&self) -> f64 {
        self.0.significance
    }
}

/// Fuses frames with the `earlier` ones; all but the newest `kept` are added up. None where they tell no place.
#[pyfunction]
#[pyo3(signature = (frames, earlier, kept))]
fn fuse_frames(
    py: Python<'_>,
    frames: Vec<GivenFactor<'_>>,
    earlier: Option<GivenSum<'_>>,
    kept: usize,
) -> PyResult<Option<Fusion>> {
    let factors: Vec<_> = frames.iter().map(GivenFactor::factor).collect::<PyResult<_>>()?;
    let earlier = earlier.as_ref().map(GivenSum::earlier).transpose()?;
    Ok(py.detach(|| {
        let fusion = fusion::fuse(&factors, earlier.as_ref())?;
        let spare = (factors.len() - fusion.first).saturating_sub(kept);
        let older = if spare > 0 { fusion.added_up(&factors, spare, earlier.as_ref()) } else { earlier };
        let older = older.filter(|_| spare > 0 || fusion.moves.is_empty());
        Some(Fusion { fusion, older })
    }))
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<SummedFactor>()?;
    m.add_class::<Fusion>()?;
    m.add_class::<Move>()?;
    m.add_function(wrap_pyfunction!(fuse_frames, m)?)
}
