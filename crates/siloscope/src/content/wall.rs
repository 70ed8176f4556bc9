//! Whether the wall still lies where the calibration has it.

use super::doubt::{Covariance, Lever, POSE};
use super::fit::Surface;
use super::returns::Returns;
use super::vessel::Vessel;
use crate::sensor::NoiseLaw;
use nalgebra::{Matrix4, Vector4};

/// How far the wall seems to have moved, as a change of the camera's pose (r_x, r_y, t_x, t_y).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// The change.
    pub change: [f64; 4],
    /// Its standard deviations: the fit's own and the calibration's.
    pub std: [f64; 4],
    /// Root of the mean square distance of the wall's returns from where the calibration has the wall, metres.
    pub rms: f64,
    /// The same when the change is taken out.
    pub left: f64,
    /// Returns used.
    pub returns: f64,
}

/// Returns looked at.
const SAMPLED: f64 = 2_500.0;
/// Returns farther from the wall than this share of the radius don't belong to it.
const GATE: f64 = 0.08;
/// Wall closer above the content than this share of the radius may be content.
const CLEARANCE: f64 = 0.1;
/// Unevenness of a wall over short distances, metres: what a return's distance scatters beside the sensor's noise.
const UNEVEN: f64 = 0.005;
/// Rounds of reweighting, and the residual beyond which a return loses all say, in standard deviations.
const ROUNDS: usize = 4;
const TUKEY: f64 = 5.0;
/// Fewest returns that tell.
const FEWEST: usize = 60;

/// One return near the wall: its distance outwards, how that changes with the pose, and its standard deviation.
struct Residual {
    distance: f64,
    by_pose: Vector4<f64>,
    sigma: f64,
}

/// Fits the pose's change to the returns near the cylinder's wall; None where they are too few to tell.
pub fn shift(
    returns: &Returns<'_>,
    vessel: &Vessel,
    lever: &Lever,
    noise: &NoiseLaw,
    covariance: &Covariance,
    surface: Option<&Surface>,
) -> Option<Shift> {
    let residuals = near_wall(returns, vessel, lever, noise, surface);
    let mut change = Vector4::zeros();
    let mut normal = Matrix4::zeros();
    if residuals.len() < FEWEST {
        return None;
    }
    for _ in 0..ROUNDS {
        let mut right = Vector4::zeros();
        normal = Matrix4::identity() * 1e-6;
        for r in &residuals {
            let left = (r.distance + r.by_pose.dot(&change)) / r.sigma;
            let weight = (1.0 - (left / TUKEY).powi(2)).max(0.0).powi(2) / (r.sigma * r.sigma);
            normal += weight * r.by_pose * r.by_pose.transpose();
            right -= weight * r.by_pose * r.distance;
        }
        change = normal.cholesky()?.solve(&right);
    }
    let own = normal.try_inverse()?;
    let rms = |change: &Vector4<f64>| {
        let square = residuals.iter().map(|r| (r.distance + r.by_pose.dot(change)).powi(2)).sum::<f64>();
        (square / residuals.len() as f64).sqrt()
    };
    Some(Shift {
        change: change.into(),
        std: POSE.map(|i| (own[(i, i)] + covariance[(i, i)]).max(0.0).sqrt()).collect::<Vec<_>>().try_into().ok()?,
        rms: rms(&Vector4::zeros()),
        left: rms(&change),
        returns: residuals.len() as f64,
    })
}

fn near_wall(
    returns: &Returns<'_>,
    vessel: &Vessel,
    lever: &Lever,
    noise: &NoiseLaw,
    surface: Option<&Surface>,
) -> Vec<Residual> {
    let stride = (returns.len() as f64 / SAMPLED).sqrt().round().max(1.0) as usize;
    let gate = GATE * vessel.radius;
    let mut residuals = Vec::new();
    returns.visit(stride, |line| {
        for i in (0..line.len()).filter(|&i| line.depth[i] > 0.0) {
            let point = [line.x[i], line.y[i], line.z[i]].map(f64::from);
            let radius = point[0].hypot(point[1]);
            let distance = radius - vessel.radius;
            let on_cylinder = point[2] > vessel.top && point[2] < vessel.cylinder_bottom - gate;
            let content = |s: &Surface| s.height(point[0], point[1]) - point[2] < CLEARANCE * vessel.radius;
            if distance.abs() < gate && on_cylinder && !surface.is_some_and(content) {
                let out = [point[0] / radius, point[1] / radius];
                let shifts = lever.shifts(point);
                let along = |k: usize| out[0] * shifts[k][0] + out[1] * shifts[k][1];
                let grazing = along(7).abs() * noise.sigma(f64::from(line.depth[i]));
                residuals.push(Residual {
                    distance,
                    by_pose: Vector4::new(along(0), along(1), along(2), along(3)),
                    sigma: grazing.hypot(UNEVEN),
                });
            }
        }
    });
    residuals
}
