//! The parameters of a wall and a sensor: names, indices, vectors, and the Jacobian between two parametrisations.

use nalgebra::{SMatrix, SVector};
use std::ops::Range;

/// Number of parameters of the fit.
pub const PARAMETERS: usize = 12;

/// Names of the parameters in their order: pose (rad, m), radius (m), cone (slope, m; intercept, m), depth bias (m, 1,
/// 1/m), ovality.
///
/// The cone's intercept is its radius m·z_a at the camera's height. The cone's radius m·z_a − m·z is linear in it and in
/// the slope. In slope and apex it is not: where little of the cone is seen, a frame leaves a long valley open between
/// them, and that would be bent.
pub const NAMES: [&str; PARAMETERS] = [
    "r_x",
    "r_y",
    "t_x",
    "t_y",
    "radius",
    "cone_slope",
    "cone_intercept",
    "offset",
    "scale",
    "quadratic",
    "oval_cos",
    "oval_sin",
];

/// Indices of the pose.
pub const POSE: Range<usize> = 0..4;
/// Index of the radius.
pub const RADIUS: usize = 4;
/// Index of the cone's slope.
pub const CONE_SLOPE: usize = 5;
/// Index of the cone's intercept.
pub const CONE_INTERCEPT: usize = 6;
/// Indices of the depth bias: offset, scale, quadratic.
pub const BIAS: Range<usize> = 7..10;
/// Index of the depth bias's scale.
pub const SCALE: usize = 8;
/// Index of the first of the ovality's two parameters.
pub const OVALITY: usize = 10;

/// One number for each parameter.
pub type Parameters = SVector<f64, PARAMETERS>;

/// Information or covariance over `Parameters`.
pub type Information = SMatrix<f64, PARAMETERS, PARAMETERS>;
