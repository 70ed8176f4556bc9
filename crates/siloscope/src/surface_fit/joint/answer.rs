//! From the weighed models to an answer in the twelve parameters that frames share.

use crate::geometry::convex_vessel::ConvexVessel;
use crate::geometry::parameters::{Information, PARAMETERS, Parameters, scale_share};
use crate::geometry::surface::{Cone, SiloSurface};
use crate::surface_fit::joint::frame::Frame;
use crate::surface_fit::joint::model::Model;
use crate::surface_fit::joint::parameters::{BIAS, CAMERA, INTERCEPT, JointState, OVAL_COLUMN, RADIUS, SIZE, SLOPE};
use crate::surface_fit::joint::search::Search;
use crate::surface_fit::joint::select::averaged;
use nalgebra::{DMatrix, DVector, SMatrix};

/// The answer of the joint fit.
#[derive(Debug, Clone)]
pub struct JointAnswer {
    /// Wall as cylinder and coaxial cone; the cone is missing where it is no hopper's, or not coaxial.
    pub surface: SiloSurface,
    /// The most probable vessel.
    pub vessel: ConvexVessel,
    /// Mean of the twelve parameters; NaN where a part is missing.
    pub parameters: Parameters,
    /// Their covariance.
    pub covariance: Information,
    /// The same if the intrinsics were exact: what frames of one camera don't have in common.
    pub relative: Information,
    /// Which parameters are estimated.
    pub free: [bool; PARAMETERS],
    /// The models with their probabilities, most probable first.
    pub models: Vec<(Model, f64)>,
    /// Which fit is the most probable model's.
    pub best: usize,
    /// Errors of the intrinsics: focal lengths (relative), principal point (rays), k1.
    pub camera: [f64; 5],
}

/// The answer of weighed models; `hopper` tells whether the cone is known to be the silo's own, `scale` is the standard
/// deviation of a depth scale that nothing tells.
pub fn answer(frame: &Frame, search: &Search, hopper: bool, scale: f64) -> Option<JointAnswer> {
    let best = search.weighed.first()?;
    let fit = search.fits.get(best.fit)?;
    let average = averaged(frame, &search.fits, &search.weighed, false)?;
    let exact = frame.inputs.camera_std == [0.0; 5];
    let relative = if exact { average.clone() } else { averaged(frame, &search.fits, &search.weighed, true)? };
    let coaxial = hopper && best.model == Model::CoaxialCone;
    let told = self::coaxial(&fit.state, (&average.mean, &average.covariance), &relative.covariance, coaxial);
    let mut free: [bool; PARAMETERS] = std::array::from_fn(|k| told.parameters[k].is_finite());
    (7..10).for_each(|k| free[k] = frame.inputs.bias_std[k - 7] > 0.0);
    (10..12).for_each(|k| free[k] = fit.state.has_cylinder);
    let Coaxial { parameters, covariance, relative } = told.with_scale(scale);
    let mut state = fit.state.clone();
    state.x = best.mean;
    let cone = coaxial.then(|| Cone::with_intercept(parameters[5], parameters[6]));
    let radius = fit.state.has_cylinder.then_some(parameters[4]);
    let mut pose = state.pose();
    (pose.r_x, pose.r_y, pose.t_x, pose.t_y) = (parameters[0], parameters[1], parameters[2], parameters[3]);
    let surface = SiloSurface { pose, radius, cone, ovality: [parameters[10], parameters[11]] };
    Some(JointAnswer {
        surface,
        vessel: state.vessel(),
        parameters,
        covariance,
        relative,
        free,
        models: search.weighed.iter().map(|w| (w.model, w.probability)).collect(),
        best: best.fit,
        camera: std::array::from_fn(|k| average.mean[CAMERA + k]),
    })
}

/// An answer in the twelve parameters of a coaxial vessel; NaN and zero rows for a part that is missing.
#[derive(Debug, Clone)]
pub struct Coaxial {
    /// Mean.
    pub parameters: Parameters,
    /// Covariance.
    pub covariance: Information,
    /// The same if the intrinsics were exact.
    pub relative: Information,
}

impl Coaxial {
    /// With the share of an unknown depth scale: every length goes with it.
    pub fn with_scale(mut self, std: f64) -> Self {
        let share = scale_share(&self.parameters, std);
        self.covariance += share;
        self.relative += share;
        self
    }
}

/// All parameters' answer about a state in twelve; without the cone where that is not the axis'.
pub fn coaxial(
    state: &JointState,
    (mean, covariance): (&DVector<f64>, &DMatrix<f64>),
    relative: &DMatrix<f64>,
    cone: bool,
) -> Coaxial {
    let map = projection(state.x[RADIUS], state.has_cylinder, cone);
    Coaxial {
        parameters: projected_mean(&map, mean, state.has_cylinder, cone),
        covariance: project(&map, covariance),
        relative: project(&map, relative),
    }
}

type Projection = SMatrix<f64, PARAMETERS, SIZE>;

/// The twelve parameters by those of the joint fit.
fn projection(radius: f64, cylinder: bool, cone: bool) -> Projection {
    let mut map = Projection::zeros();
    (0..4).for_each(|k| map[(k, k)] = 1.0);
    (0..3).for_each(|k| map[(7 + k, BIAS + k)] = 1.0);
    if cylinder {
        map[(4, RADIUS)] = 1.0;
        (0..2).for_each(|k| map[(10 + k, OVAL_COLUMN + k)] = 1.0 / radius);
    }
    if cone {
        (map[(5, SLOPE)], map[(6, INTERCEPT)]) = (1.0, 1.0);
    }
    map
}

fn projected_mean(map: &Projection, of: &DVector<f64>, cylinder: bool, cone: bool) -> Parameters {
    let mut mean = Parameters::from_fn(|k, _| (0..SIZE).map(|c| map[(k, c)] * of[c]).sum());
    if !cylinder {
        mean[4] = f64::NAN;
    }
    if !cone {
        (mean[5], mean[6]) = (f64::NAN, f64::NAN);
    }
    mean
}

fn project(map: &Projection, covariance: &DMatrix<f64>) -> Information {
    let half = DMatrix::from_fn(PARAMETERS, SIZE, |r, c| map[(r, c)]);
    let full = &half * covariance * half.transpose();
    Information::from_fn(|r, c| 0.5 * (full[(r, c)] + full[(c, r)]))
}
