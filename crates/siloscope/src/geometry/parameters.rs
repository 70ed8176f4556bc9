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
/// Index of the depth bias's quadratic part.
pub const QUADRATIC: usize = 9;
/// Index of the first of the ovality's two parameters.
pub const OVALITY: usize = 10;

/// One number for each parameter.
pub type Parameters = SVector<f64, PARAMETERS>;

/// Information or covariance over `Parameters`.
pub type Information = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// The share of an unknown depth scale in a covariance: every length goes with it, and what the sensor reads stays as it is.
///
/// Where all lengths are λ times as long, 1 + b becomes (1 + b) / λ and q becomes q / λ². Lengths that are not finite were
/// not seen and have no share.
pub fn scale_share(parameters: &Parameters, std: f64) -> Information {
    let rate = |k: usize| match (k, parameters[k]) {
        (2 | 3 | RADIUS | CONE_INTERCEPT, length) if length.is_finite() => length,
        (SCALE, b) => -(1.0 + b),
        (QUADRATIC, q) => -2.0 * q,
        _ => 0.0,
    };
    let along = Parameters::from_fn(|k, _| std * rate(k));
    along * along.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_scale_leaves_readings_as_they_are() {
        let mut p = Parameters::from_fn(|k, _| 0.1 * k as f64 + 0.2);
        p[CONE_SLOPE] = f64::NAN;
        p[CONE_INTERCEPT] = f64::NAN;
        let (std, depth) = (1e-4, 3.0);
        let share = scale_share(&p, std);
        let step = share.column(RADIUS) / (p[RADIUS] * std); // along the only direction, one deviation of the scale
        let longer = 1.0 + std;
        let reading = |p: &Parameters, d: f64| p[BIAS.start] + (1.0 + p[SCALE]) * d + p[QUADRATIC] * d * d;
        let moved = p + step;
        assert!((reading(&moved, depth * longer) - reading(&p, depth)).abs() < 1e-6);
        assert!((moved[2] - longer * p[2]).abs() < 1e-12 && (moved[3] - longer * p[3]).abs() < 1e-12);
        assert_eq!(share.column(CONE_INTERCEPT), Parameters::zeros());
    }
}
