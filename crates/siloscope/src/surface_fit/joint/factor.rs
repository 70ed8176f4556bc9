//! What one frame alone says, for other frames of the same silo and camera.

use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::{JointState, SIZE};
use crate::surface_fit::joint::select::Weighed;
use crate::surface_fit::joint::solve::JointFit;
use nalgebra::{DMatrix, DVector};

/// A frame's negative log-likelihood ½ δᵀ H δ + gᵀ δ about a state, over pose, geometry, form, intrinsics and bias.
///
/// No prior is in it. Columns of parts that the frame does not show are zero. See `parameters` for their order.
#[derive(Debug, Clone)]
pub struct JointFactor {
    /// The most probable model.
    pub model: Model,
    /// Every model's ln p(frame, model) with the frame's own priors, up to a constant.
    pub log_evidence: Vec<(Model, f64)>,
    /// Linearisation point θ₀.
    pub state: JointState,
    /// H (SIZE × SIZE), the information; already divided by the correlation factors within the frame.
    pub information: DMatrix<f64>,
    /// g, the gradient at θ₀.
    pub gradient: DVector<f64>,
    /// Fraction of H's score variance that the sensor's noise makes: new in every frame.
    pub sensor_fraction: f64,
    /// Model error of cylinder and cone, metres.
    pub tau: [f64; 2],
    /// Number of wall tiles of cylinder and cone.
    pub tiles: [f64; 2],
}

impl JointFactor {
    /// Of a fit with the models' weights.
    pub fn new(frame: &Frame, fit: &JointFit, weighed: &[Weighed]) -> Self {
        Self {
            model: weighed.first().map_or(fit.model, |w| w.model),
            log_evidence: weighed.iter().map(|w| (w.model, w.log_evidence)).collect(),
            state: fit.state.clone(),
            information: fit.quadratic.information.clone(),
            gradient: fit.quadratic.gradient.clone(),
            sensor_fraction: super::answer::sensor_fraction(frame, fit),
            tau: fit.tau,
            tiles: super::search::wall_tiles(fit),
        }
    }

    /// The gradient at another point: g + H (θ − θ₀).
    pub fn gradient_at(&self, x: &[f64; SIZE]) -> DVector<f64> {
        let off = DVector::from_fn(SIZE, |k, _| x[k] - self.state.x[k]);
        &self.gradient + &self.information * off
    }
}
