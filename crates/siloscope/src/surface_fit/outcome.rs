//! What the surface fit is given and what it gives.

use crate::Vec3;
use crate::base::refusal::Refusal;
use crate::geometry::evaluator::SurfaceEvaluator;
use crate::geometry::parameters::{Information, PARAMETERS, Parameters};
use crate::geometry::sensor::{DepthError, NoiseLaw};
use crate::surface_fit::diagnostics::WallEvidence;
use crate::surface_fit::frame_factor::FrameFactor;
use crate::surface_fit::joint::summary::JointSummary;
use crate::surface_fit::solver::{Fit, Prior};
use crate::surface_fit::tiles::Patches;
use crate::surface_fit::warm_start::KnownWall;

/// What the caller knows.
#[derive(Debug, Clone)]
pub struct Knowledge {
    /// The sensor's depth error.
    pub error: DepthError,
    /// Radius of the cylinder and its standard deviation, metres.
    pub radius: Option<(f64, f64)>,
    /// Direction of gravity in the camera frame and its standard deviation, radians.
    pub gravity: Option<(Vec3, f64)>,
    /// Standard deviations of the intrinsics: focal lengths (relative), principal point (rays), k1; 0 where exact.
    pub camera_std: [f64; 5],
    /// Whether the vessel is said to end in a cone about its own axis: then one that is seen alone has that axis.
    pub told_cone: bool,
    /// Whether an answer that is no vessel's, or not sure, is refused; else it is given, to tell what is wrong with it.
    pub judged: bool,
}

impl Knowledge {
    /// As the fits on tiles have it.
    pub(crate) fn prior(&self) -> Prior {
        let mut bias_std = self.error.bias_std;
        if self.radius.is_some() && bias_std[1] > 0.0 {
            bias_std[1] = bias_std[1].max(0.05); // a known radius fixes the scale better than any expectation
        }
        Prior { bias: self.error.bias, bias_std, radius: self.radius, gravity: self.gravity, ovality_std: 0.0 }
    }
}

/// Result of the fit, before it is judged.
#[derive(Debug, Clone)]
pub struct SurfaceFit {
    /// State: surface, bias, misfit.
    pub fit: Fit,
    /// Covariance over all parameters; zero rows for those that are not free.
    pub covariance: Information,
    /// What this frame alone says, without priors (for fusing frames).
    pub factor: FrameFactor,
    /// Which parameters are estimated.
    pub free: [bool; PARAMETERS],
    /// Noise law used.
    pub noise: NoiseLaw,
    /// Residual scatter over expectation (reduced chi-square) of the tiles.
    pub chi_square: f64,
    /// What the wall looks like.
    pub evidence: WallEvidence,
    /// The wall as patches show it, for other frames of the same camera.
    pub wall: KnownWall,
    /// The patches.
    pub patches: Patches,
    /// Final residual of each wall patch across the wall, metres; NaN elsewhere.
    pub residuals: Vec<f64>,
    /// Milliseconds of each stage, in order.
    pub timing: Vec<(&'static str, f64)>,
    /// What the joint fit says beside the wall; `None` for clouds and views from outside.
    pub joint: Option<Box<JointSummary>>,
}

/// A fit, or why there is none.
pub type Outcome = std::result::Result<SurfaceFit, Refusal>;

/// Largest standard deviation of the axis' direction that still is an answer, radians.
pub(crate) const MAX_DIRECTION_STD: f64 = 0.02;
/// Largest standard deviation of the axis' position that still is an answer, as a share of the radius.
pub(crate) const MAX_POSITION_STD: f64 = 0.05;

/// Whether the axis is known well enough: its direction, and its position in the middle of the wall that was seen.
pub(crate) fn check_determined(
    covariance: &Information,
    placed: &SurfaceEvaluator,
    height: f64,
) -> std::result::Result<(), Refusal> {
    let [x, y] = placed.axis_shift(height);
    let variance = |row: &Parameters| row.dot(&(covariance * row));
    let direction = (covariance[(0, 0)] + covariance[(1, 1)]).sqrt();
    let position = (variance(&x) + variance(&y)).sqrt();
    match (direction < MAX_DIRECTION_STD, position < MAX_POSITION_STD * placed.surface.size()) {
        (true, true) => Ok(()),
        (true, false) => Err(Refusal::PositionUnknown),
        (false, true) => Err(Refusal::DirectionUnknown),
        (false, false) => Err(Refusal::PoorlyDetermined),
    }
}
