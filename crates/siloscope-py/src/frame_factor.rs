//! What one frame alone says, out of the core and back.

use crate::arrays::{in_c_order, rows};
use crate::convert::value_error;
use crate::inputs::depth_bias;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use siloscope::SiloPose;
use siloscope::surface_fit::frame_factor;
use siloscope::surface_fit::frame_factor::Kind;
use siloscope::surface_fit::joint::model::{Inputs, Model};
use siloscope::surface_fit::joint::parameters::{JointState, SIZE};

/// A frame's factor, without priors; the fields of `siloscope.types.frame_factor.FrameFactor`.
#[pyclass(frozen, module = "siloscope._core")]
pub struct FrameFactor(pub frame_factor::FrameFactor);

#[pymethods]
impl FrameFactor {
    /// All parameters (71,) at the linearisation point.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.state.x)
    }

    /// Whether a cylinder was seen.
    #[getter]
    fn has_cylinder(&self) -> bool {
        self.0.state.has_cylinder
    }

    /// Whether a cone was seen.
    #[getter]
    fn has_cone(&self) -> bool {
        self.0.state.has_cone
    }

    /// Height to which the form and the cone's offset are told, m.
    #[getter]
    fn reference(&self) -> f64 {
        self.0.state.reference
    }

    /// The frame's own most probable model.
    #[getter]
    fn model(&self) -> &'static str {
        self.0.model.slug()
    }

    /// Whether the frame knows that its cone is the silo's own.
    #[getter]
    fn hopper(&self) -> bool {
        self.0.hopper
    }

    /// What its tiles say.
    #[getter]
    fn shares(&self) -> Vec<Share> {
        self.0.shares.iter().cloned().map(Share).collect()
    }

    /// Expected depth bias (3,).
    #[getter]
    fn bias(&self) -> [f64; 3] {
        let bias = self.0.known.bias;
        [bias.offset, bias.scale, bias.quadratic]
    }

    /// Its standard deviations (3,); 0 where exact or held.
    #[getter]
    fn bias_std(&self) -> [f64; 3] {
        self.0.known.bias_std
    }

    /// Radius by the tape and its standard deviation, m; None where not known.
    #[getter]
    fn radius(&self) -> Option<(f64, f64)> {
        self.0.known.radius
    }

    /// r_x and r_y by gravity and their standard deviation, rad; None where not known.
    #[getter]
    fn gravity(&self) -> Option<(f64, f64, f64)> {
        self.0.known.gravity.map(|(pose, std)| (pose.r_x, pose.r_y, std))
    }

    /// Standard deviations (5,) of the intrinsics; 0 where exact.
    #[getter]
    fn camera_std(&self) -> [f64; 5] {
        self.0.known.camera_std
    }

    /// Standard deviation of the depth scale where no frame can tell it, else 0.
    #[getter]
    fn scale_std(&self) -> f64 {
        self.0.scale_std
    }

    /// Some of the wall's rays (K, 3): (x, y) of (x, y, 1) and their information, 1/m².
    #[getter]
    fn rays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.0.rays)
    }
}

/// What some tiles of a frame say; the fields of `siloscope.types.frame_factor.Share`.
#[pyclass(frozen, module = "siloscope._core")]
pub struct Share(frame_factor::Share);

#[pymethods]
impl Share {
    /// cylinder, cone or whole.
    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind.slug()
    }

    /// Upper triangle of the information, row by row.
    #[getter]
    fn information<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let n = self.0.gradient.len();
        PyArray1::from_iter(py, (0..n).flat_map(|r| (r..n).map(move |c| (r, c))).map(|(r, c)| self.0.value(r, c)))
    }

    /// Gradient of the negative log-likelihood.
    #[getter]
    fn gradient<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.gradient)
    }

    /// Fraction of the gradient's variance that is new in every frame.
    #[getter]
    fn sensor_fraction(&self) -> f64 {
        self.0.sensor_fraction
    }

    /// Fraction of the frame's tiles.
    #[getter]
    fn seen(&self) -> f64 {
        self.0.seen
    }
}

/// `siloscope.types.frame_factor.Share`.
#[derive(FromPyObject)]
struct GivenShare<'py> {
    kind: String,
    information: PyReadonlyArray1<'py, f64>,
    gradient: PyReadonlyArray1<'py, f64>,
    sensor_fraction: f64,
    seen: f64,
}

impl GivenShare<'_> {
    fn share(&self) -> PyResult<frame_factor::Share> {
        let kind = Kind::ALL.into_iter().find(|kind| kind.slug() == self.kind);
        let kind = kind.ok_or_else(|| value_error(format!("a share is of the unknown kind {}", self.kind)))?;
        let (upper, gradient) = (in_c_order(&self.information)?, in_c_order(&self.gradient)?);
        let n = kind.columns().len();
        if gradient.len() != n || upper.len() != n * (n + 1) / 2 {
            return Err(value_error(format!("a share has {} and {} numbers", gradient.len(), upper.len())));
        }
        let first = |r: usize| r * n - r * (r.max(1) - 1) / 2; // where row r of the triangle begins
        let value = |r: usize, c: usize| if r <= c { upper[first(r) + c - r] } else { upper[first(c) + r - c] };
        Ok(frame_factor::Share {
            kind,
            information: (0..n).flat_map(|r| (0..n).map(move |c| (r, c))).map(|(r, c)| value(r, c)).collect(),
            gradient: gradient.to_vec(),
            sensor_fraction: self.sensor_fraction,
            seen: self.seen,
        })
    }
}

/// `siloscope.types.frame_factor.FrameFactor`.
#[derive(FromPyObject)]
pub struct GivenFactor<'py> {
    state: PyReadonlyArray1<'py, f64>,
    has_cylinder: bool,
    has_cone: bool,
    reference: f64,
    model: String,
    hopper: bool,
    shares: Vec<GivenShare<'py>>,
    bias: [f64; 3],
    bias_std: [f64; 3],
    radius: Option<(f64, f64)>,
    gravity: Option<(f64, f64, f64)>,
    camera_std: [f64; 5],
    scale_std: f64,
    rays: PyReadonlyArray2<'py, f64>,
}

impl GivenFactor<'_> {
    /// In the core's own form.
    pub fn factor(&self) -> PyResult<frame_factor::FrameFactor> {
        let x: [f64; SIZE] = in_c_order(&self.state)?.as_ref().try_into().map_err(value_error)?;
        let model = Model::ALL.into_iter().find(|model| model.slug() == self.model);
        let angles = |(r_x, r_y, std)| (SiloPose { r_x, r_y, ..SiloPose::default() }, std);
        let known = Inputs {
            bias: depth_bias(self.bias),
            bias_std: self.bias_std,
            radius: self.radius,
            gravity: self.gravity.map(angles),
            camera_std: self.camera_std,
        };
        Ok(frame_factor::FrameFactor {
            state: JointState {
                x,
                has_cylinder: self.has_cylinder,
                has_cone: self.has_cone,
                reference: self.reference,
            },
            model: model.ok_or_else(|| value_error(format!("the model {} is unknown", self.model)))?,
            hopper: self.hopper,
            shares: self.shares.iter().map(GivenShare::share).collect::<PyResult<_>>()?,
            known,
            scale_std: self.scale_std,
            rays: crate::arrays::points(&self.rays)?,
        })
    }
}

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<FrameFactor>()?;
    m.add_class::<Share>()
}
